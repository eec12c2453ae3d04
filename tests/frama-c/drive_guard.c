/* SPDX-License-Identifier: MIT */
/* The guard with any limits and any samples, for Frama-C's Eva: no undefined behaviour whatever comes in. */
#include "tests/frama-c/any.h"

#include "guard/guard.h"
#include "guard/guard_real.h"

static struct guard_sample any_sample(void)
{
    struct guard_sample sample = {any_i32(), any_i32(), any_i32(), any_bool()};
    return sample;
}

static struct guard_real_sample any_real_sample(void)
{
    struct guard_real_sample sample = {any_real(), any_real(), any_real(), any_bool()};
    return sample;
}

int main(void)
{
    struct guard guard;
    struct guard_real real;
    struct guard_limits limits = {any_i32(), any_i32(), any_i32(), any_i32(), any_u32(), any_u32(), any_i32()};
    struct guard_real_limits real_limits = {any_real(), any_real(), any_real(), any_real(),
                                            any_u32(),  any_u32(),  any_real()};
    if (guard_init(&guard, &limits) != core_ok) {
        return 0;
    }
    if (guard_real_init(&real, &real_limits) != core_ok) {
        return 0;
    }
    while (any_bool()) {
        struct guard_sample sample = any_sample();
        struct guard_real_sample real_sample = any_real_sample();
        if (any_bool()) {
            guard_alive(&guard.state);
            guard_alive(&real.state);
        }
        if (any_bool()) {
            guard_arm(&guard, &sample);
            guard_real_arm(&real, &real_sample);
        }
        guard_step(&guard, &sample);
        guard_real_step(&real, &real_sample);
        guard_clip_torque(&guard, any_i32());
        guard_real_clip_torque(&real, any_real());
        guard_cause_str(guard.state.cause);
    }
    return 0;
}
