#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Takes each safety check out, one at a time, and demands that a test notices.

usage: mutants.py UNITY_FOLDER [NAME...]
Compiles copies of lib/guard and of the simulated drive into a temporary folder; the source tree is not touched. A mutant is a
text of a source file and what stands there instead; the text has to be there exactly once, so that a check that was rewritten
gets a new mutant. NAME: only these mutants.
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
LATCH, GUARD, REAL = "lib/guard/latch.c", "lib/guard/guard.c", "lib/guard/guard_real.c"
MOTION, OBJECTS, DRIVE = (f"sim/node/simulated_drive{part}.c" for part in ("_motion", "_objects", ""))
MACHINE = "drivers/can/cia402.c"
PLAYER, MODBUS = "drivers/modbus/table_player.c", "sim/node/modbus_drive.c"

# name, file, text, instead of it
MUTANTS = [
    ("guard_sensor", GUARD, "if (!sample->valid) {", "if (0) {"),
    ("guard_travel_low", GUARD, "sample->position >= limits->position_min &&", "1 &&"),
    ("guard_travel_low_exclusive", GUARD, "sample->position >= limits->position_min &&",
     "sample->position > limits->position_min &&"),
    ("guard_travel_high", GUARD, "&& sample->position <= limits->position_max)", "&& 1)"),
    ("guard_travel_high_exclusive", GUARD, "sample->position <= limits->position_max)",
     "sample->position < limits->position_max)"),
    ("guard_speed_low", GUARD, "sample->velocity >= -limits->velocity_max &&", "1 &&"),
    ("guard_speed_high", GUARD, "&& sample->velocity <= limits->velocity_max)", "&& 1)"),
    ("guard_speed_exclusive", GUARD, "sample->velocity <= limits->velocity_max)",
     "sample->velocity < limits->velocity_max)"),
    ("guard_stuck_positive", GUARD, "sample->torque >= limits->stuck_torque ||", "0 ||"),
    ("guard_stuck_negative", GUARD, "|| sample->torque <= -limits->stuck_torque)", "|| 0)"),
    ("guard_arm_outside", GUARD, "judge(self, now) == guard_cause_none", "1"),
    ("guard_clip", GUARD, "core_saturate_i32(torque, self->limits.torque_max, &clipped)", "torque"),
    ("real_finite_position", REAL, "!is_finite(sample->position_rad) ||", "0 ||"),
    ("real_finite_velocity", REAL, "!is_finite(sample->velocity_rad_per_s) ||", "0 ||"),
    ("real_finite_torque", REAL, "!is_finite(sample->torque_Nm))", "0)"),
    ("real_valid", REAL, "if (!sample->valid ||", "if ("),
    ("real_travel", REAL, "if (!is_within(sample->position_rad, limits->position_min_rad, limits->position_max_rad)) {",
     "if (0) {"),
    ("real_speed", REAL,
     "if (!is_within(sample->velocity_rad_per_s, -limits->velocity_max_rad_per_s, limits->velocity_max_rad_per_s)) {",
     "if (0) {"),
    ("real_clip_high", REAL, "if (torque_Nm > limit) {\n        return limit;", "if (torque_Nm > limit) {\n        return torque_Nm;"),
    ("real_clip_nan", REAL, "return torque_Nm < -limit ? -limit : 0;", "return torque_Nm < -limit ? -limit : torque_Nm;"),
    ("real_stuck", REAL, "unmoved && loaded", "0"),
    ("latch_watchdog", LATCH, "self->silent_samples > self->watchdog_samples", "0"),
    ("latch_watchdog_early", LATCH, "self->silent_samples > self->watchdog_samples",
     "self->silent_samples >= self->watchdog_samples"),
    ("latch_stuck", LATCH, "self->still_samples >= self->stuck_samples", "0"),
    ("latch_holds", LATCH, "return self->mode == guard_armed ? guard_run : guard_ramp_down;",
     "return cause == guard_cause_none ? guard_run : guard_ramp_down;"),
    ("latch_rearm_refused", LATCH, "self->mode = self->mode == guard_tripped ? guard_tripped : guard_idle;",
     "self->mode = guard_armed;"),
    ("drive_encoder_dead", MOTION, "if (!isfinite(self->sample.position) || !isfinite(self->sample.velocity))", "if (0)"),
    ("drive_following_error", MOTION, "<= (int64_t)o->following_error_window)", "<= INT64_MAX)"),
    ("drive_following_error_exclusive", MOTION, "<= (int64_t)o->following_error_window)",
     "< (int64_t)o->following_error_window)"),
    ("drive_travel_above", MOTION, "o->position_actual > o->position_max &&", "0 &&"),
    ("drive_travel_below", MOTION, "o->position_actual < o->position_min &&", "0 &&"),
    ("drive_end_stop", MOTION, "|| self->drive.hit_end_stop)", "|| 0)"),
    ("drive_travel_clip", MOTION, "clipped(o->target_position, o->position_min, o->position_max, &self->limited)",
     "o->target_position"),
    ("drive_speed", MOTION, "!(fabs(self->sample.velocity) <= limit * unit)", "0"),
    ("drive_speed_exclusive", MOTION, "fabs(self->sample.velocity) <= limit * unit", "fabs(self->sample.velocity) < limit * unit"),
    ("drive_speed_clip", MOTION, "velocity = clipped(velocity, -limit, limit, &self->limited);", ";"),
    ("drive_blocked", MOTION, "< o->blocked_torque)", "< INT32_MAX)"),
    ("drive_runs_away", MOTION, "if (is_running_away(self)) {", "if (0) {"),
    ("drive_torque_limit", OBJECTS, "self->drive.torque_limit = (double)value * self->scaling.torque;", ";"),
    ("drive_old_setpoints", OBJECTS, "self->followed_position = o->target_position = o->position_actual;", ";"),
    ("drive_period", DRIVE, "self->period.wrong = !(fabs(mean_us - nominal_us) <= self->period_tolerance * nominal_us);",
     "self->period.wrong = false;"),
    ("drive_second_commander", DRIVE, "if (!refuse_second_commander(self, frame))", "if (1)"),
    ("drive_lost_connection", DRIVE,
     "simulated_drive_detect(self, emcy_code, emcy_communication_error, simulated_reaction_by_option);", ";"),
    ("machine_reset_edge", MACHINE, "(control_word & 0x80) && !(self->control_word & 0x80)", "(control_word & 0x80)"),
    ("machine_latched", MACHINE, "[FA] = {FA, FA, FA, FA,", "[FA] = {FA, FA, FA, OE,"),
    ("machine_quick_stop_runs_out", MACHINE, "&& !stays_in_quick_stop(self))\n        return false;", "&& 0)\n        return false;"),
    ("modbus_following", PLAYER, "!(error >= -allowed && error <= allowed)", "0"),
    ("modbus_guard", PLAYER, "guard_real_step(&self->guard, &now) == guard_ramp_down && self->end", "0 && self->end"),
    ("modbus_watchdog", PLAYER, "if (setup->host_timeout_ms > 0) {", "if (0) {"),
    ("modbus_arm_outside", PLAYER, "guard_real_arm(&self->guard, &now) : status;", "(guard_real_arm(&self->guard, &now), core_ok) : status;"),
    ("modbus_clip", PLAYER, "guard_real_clip_torque(&self->guard, (core_real)values[msgen_channel_torque])", "values[msgen_channel_torque]"),
    ("modbus_end_stop", MODBUS, "if (self->drive.hit_end_stop && !had_hit)", "if (0)"),
    ("modbus_rest", PLAYER, "const double table_player_rest_s = 0.5;", "const double table_player_rest_s = 0;"),
]

GROUPS = {
    "guard": (["tests/unit/test_guard.c"], ["lib/guard", "lib/core"]),
    "drive": (["tests/unit/test_simulated_drive.c"], ["lib/core", "sim", "sim/effects", "sim/node", "drivers/can"]),
    "machine": (["tests/unit/test_cia402.c"], ["drivers/can"]),
    "modbus": (["tests/unit/test_modbus_player.c"],
               ["lib/core", "lib/msgen", "lib/frf", "lib/guard", "sim", "sim/effects", "sim/node", "drivers/modbus"]),
}
# The door's own half and other nodes need more than these tests do.
LEFT_OUT = {"cia402_master.c", "cia402_setup.c", "cia402_profile.c", "canopen_master.c"}


def group_of(file):
    if file in (PLAYER, MODBUS):
        return "modbus"
    return "guard" if file.startswith("lib/guard") else "machine" if file == MACHINE else "drive"


class Workshop:
    def __init__(self, folder, unity):
        self.folder, self.unity = pathlib.Path(folder), unity
        self.objects = {}

    def compile(self, source, name):
        out = self.folder / (name + ".o")
        subprocess.run(["cc", "-std=c11", "-O1", "-w", "-D_POSIX_C_SOURCE=200809L", "-DUNITY_INCLUDE_DOUBLE",
                        "-DUNITY_SUPPORT_64", "-ffp-contract=off", f"-I{ROOT}", f"-I{ROOT}/lib", f"-I{self.unity}", "-c", source,
                        "-o", out], check=True)
        return out

    def sources(self, group):
        tests, rooms = GROUPS[group]
        for test in tests:
            yield test
        for room in rooms:
            for path in sorted((ROOT / room).glob("*.c")):
                own = "modbus_drive" if group == "modbus" else "simulated_drive"
                node = room == "sim/node" and not path.name.startswith(own)
                if path.name not in LEFT_OUT and not node:
                    yield str(path.relative_to(ROOT))

    def effects(self):
        names = sorted(path.stem for path in (ROOT / "sim/effects").glob("*.c"))
        text = '#include "sim/effect.h"\n#include <stddef.h>\n'
        text += "".join(f"extern const struct sim_effect sim_effect_{name};\n" for name in names)
        text += "const struct sim_effect *const sim_effects[] = {" + "".join(f"&sim_effect_{name}, " for name in names) + "NULL};\n"
        path = self.folder / "effects.c"
        path.write_text(text)
        return path

    def prepare(self, group):
        objects = {}
        for source in self.sources(group):
            if source not in self.objects:
                self.objects[source] = self.compile(ROOT / source, source.replace("/", "_"))
            objects[source] = self.objects[source]
        if "unity" not in self.objects:
            self.objects["unity"] = self.compile(pathlib.Path(self.unity) / "unity.c", "unity")
            self.objects["effects"] = self.compile(self.effects(), "effects_list")
        objects["unity"] = self.objects["unity"]
        if group in ("drive", "modbus"):
            objects["effects"] = self.objects["effects"]
        return objects

    def passes(self, objects):
        program = self.folder / "program"
        subprocess.run(["cc", *objects.values(), "-lm", "-o", program], check=True)
        result = subprocess.run([program], capture_output=True, text=True, timeout=60)
        failed = [line.split(":")[2] for line in result.stdout.splitlines() if ":FAIL" in line]
        return result.returncode == 0, failed


def main():
    unity, wanted = sys.argv[1], sys.argv[2:]
    folder = tempfile.mkdtemp()
    survivors = 0
    try:
        workshop = Workshop(folder, unity)
        prepared = {}
        for name, file, text, instead in MUTANTS:
            if wanted and name not in wanted:
                continue
            group = group_of(file)
            if group not in prepared:
                prepared[group] = workshop.prepare(group)
                if not workshop.passes(prepared[group])[0]:
                    sys.exit(f"{GROUPS[group][0][0]} fails without any mutant")
            source = (ROOT / file).read_text()
            if source.count(text) != 1:
                sys.exit(f"mutant {name}: expected once in {file}, found {source.count(text)} times: {text}")
            mutated = pathlib.Path(folder) / os.path.basename(file)
            mutated.write_text(source.replace(text, instead))
            objects = dict(prepared[group])
            objects[file] = workshop.compile(mutated, "mutant")
            passed, failed = workshop.passes(objects)
            print(f"{name}: {'SURVIVES' if passed else 'killed by ' + (failed[0] if failed else 'a crash')}")
            survivors += passed
    finally:
        shutil.rmtree(folder)
    sys.exit(f"{survivors} mutants survive" if survivors else 0)


if __name__ == "__main__":
    main()
