/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/wording.h"

#include "lab/diagnose/blackbox.h"
#include "lab/diagnose/cause_gain.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/// Places behind the point that a range is known to.
static int places_of(const struct misfit_range *r)
{
    double places = r->step > 0.0 ? ceil(-log10(r->step)) : 3.0;
    return (int)fmin(fmax(places, 0.0), 9.0);
}

/// Something between two numbers, or on one side of one.
static void describe_span(const struct misfit_range *r, const char *lead, const char *unit, char out_text[wording_size])
{
    int places = places_of(r);
    if (r->open_low)
        snprintf(out_text, wording_size, "%s below %.*f %s", lead, places, r->high, unit);
    else if (r->open_high)
        snprintf(out_text, wording_size, "%s above %.*f %s", lead, places, r->low, unit);
    else
        snprintf(out_text, wording_size, "%s %.*f to %.*f %s", lead, places, r->low, places, r->high, unit);
}

static void describe_time(const struct misfit_range *r, char out_text[wording_size])
{
    int places = places_of(r);
    if (r->open_low)
        snprintf(out_text, wording_size, "before %.*f s", places, r->high);
    else if (r->open_high)
        snprintf(out_text, wording_size, "from %.*f s on", places, r->low);
    else
        snprintf(out_text, wording_size, "from %.*f to %.*f s", places, r->low, places, r->high);
}

void wording_range(const struct diagnosis *self, enum misfit_axis_kind axis, const struct misfit_range *range,
                   char out_text[wording_size])
{
    struct wording_units units = wording_units(self);
    char lead[wording_short];
    switch (axis) {
    case misfit_frequency:
        snprintf(out_text, wording_size, "at %.3g..%.3g Hz", range->low, range->high);
        return;
    case misfit_speed:
        describe_span(range, "at speeds", units.speed_unit, out_text);
        return;
    case misfit_position:
        describe_span(range, "at positions", self->linear ? "m" : "rad", out_text);
        return;
    case misfit_direction:
        snprintf(out_text, wording_size, "moving %s", range->first == 0 ? "backward" : "forward");
        return;
    case misfit_level:
        snprintf(lead, sizeof lead, "under a %s", units.torque);
        describe_span(range, lead, units.torque_unit, out_text);
        return;
    case misfit_time:
    case misfit_axes:
        break;
    }
    describe_time(range, out_text);
}

void wording_where(const struct diagnosis *self, const struct misfit *misfit, enum misfit_model model,
                   char out_text[wording_size])
{
    const size_t most = 3; // axes: more would hide the telling ones
    enum misfit_axis_kind axes[misfit_axes];
    size_t count = misfit_is_left(misfit, model) ? misfit_order(misfit, model, axes) : 0, used = 0;
    out_text[0] = '\0';
    for (size_t i = 0; i < count && i < most; i++) {
        const struct misfit_range *range = &misfit->axes[axes[i]].range[model];
        char place[wording_size];
        wording_range(self, axes[i], range, place);
        used += (size_t)snprintf(out_text + used, wording_size - used, "%s%s (%.0f %%%s)", i > 0 ? ", " : "", place,
                                 100.0 * range->share, i == 0 ? " of it" : "");
        if (used >= wording_size)
            return;
    }
}

/// How much more a model leaves than noise makes, relative to that.
static double excess(const struct misfit *misfit)
{
    return misfit->values > 0.0 ? misfit->squares[misfit_extended] / misfit->values : 0.0;
}

void wording_rest(const struct diagnosis *self, const char *reason, char out_text[wording_where_size])
{
    bool fitted = excess(&self->fitted_misfit) > excess(&self->misfit);
    char place[wording_size];
    int room = wording_where_size / 2;
    const struct misfit *misfit = fitted ? &self->fitted_misfit : &self->misfit;
    wording_where(self, misfit, misfit_extended, place);
    if (!place[0] && misfit_is_left(misfit, misfit_extended))
        snprintf(place, sizeof place, "everywhere alike");
    snprintf(out_text, wording_where_size, "%.*s%s%s%.*s", room - 32, place,
             place[0] && fitted ? ", on the fitted runs" : "", place[0] && reason[0] ? "; " : "", room - 32, reason);
}

void wording_left(const struct diagnosis *self, char out_text[wording_size])
{
    const double next_to_nothing = 0.005, noisy = 1.25;
    char share[wording_short], times[2 * wording_short] = "";
    double left = fmax(self->extended.mean_rms, sqrt(fmax(self->fit_misfit, 0.0)));
    if (left > noisy)
        snprintf(times, sizeof times, " (%.3g times what noise makes)", left);
    wording_percent(self->unexplained_share, share);
    if (self->unexplained_share < next_to_nothing && !times[0])
        snprintf(out_text, wording_size, "On average next to nothing of the given model's misfit stays (%s), but %s",
                 share, self->where[0] ? self->where : "what it is made of is not known");
    else
        snprintf(out_text, wording_size, "%s of the given model's misfit stays%s%s%s", share, times,
                 self->where[0] ? ": " : "", self->where);
}

void wording_unseen(const struct diagnosis *self, const struct diagnosis_cause *cause, char out_text[wording_size])
{
    char without[wording_short], with[wording_short];
    out_text[0] = '\0';
    if (!isfinite(cause->gain.unseen_nats))
        return;
    wording_percent(cause->gain.without.validation_nrmse, without);
    wording_percent(self->extended.validation_nrmse, with);
    if (cause_gain_is_hidden(cause))
        snprintf(out_text, wording_size,
                 "It cannot show in the data judged on, and is neither confirmed nor refuted there.");
    else if (cause->gain.unseen_nats > 0.0 && !isfinite(cause->gain.without.validation_nrmse))
        snprintf(out_text, wording_size, "On unseen data it earns %.0f nats.", cause->gain.unseen_nats);
    else if (cause->gain.unseen_nats < 0.0)
        snprintf(out_text, wording_size,
                 "On unseen data it does harm as it stands (%.0f nats): its size does not hold there.",
                 cause->gain.unseen_nats);
    else if (sim_effects[cause->effect]->in_time) // the error is that of the mean of the periods, which hides it
        snprintf(out_text, wording_size,
                 "On unseen data it earns %.0f nats; without it, the rest refitted, one-step errors there are %.3f "
                 "instead of %.3f times what is expected.",
                 cause->gain.unseen_nats, cause->gain.without.whitened_rms, self->extended.whitened_rms);
    else
        snprintf(
            out_text, wording_size,
            "On unseen data it earns %.0f nats; without it, the rest refitted, the error there is %s instead of %s.",
            cause->gain.unseen_nats, without, with);
}

/// What to measure where an axis says most.
static const char *closer_look(enum misfit_axis_kind axis)
{
    switch (axis) {
    case misfit_frequency:
        return "an excitation with its power there, at two levels: a linear cause keeps its shape, any other does not";
    case misfit_speed:
        return "constant speeds there, several of them, both ways";
    case misfit_position:
        return "slow strokes over that place, there and back";
    case misfit_direction:
        return "constant speeds, the same ones both ways";
    case misfit_level:
        return "the same excitation at half the level and at twice that";
    case misfit_time:
    case misfit_axes:
        break;
    }
    return "the same again for longer: whether it comes back, goes on, or was an event";
}

/// What to measure to see the shape that a black box found.
static const char *look_at_shape(int group)
{
    switch (group) {
    case blackbox_speed:
        return "constant speeds from creeping to the highest, both ways: torque against speed is its curve";
    case blackbox_position:
        return "one slow stroke at constant speed over the whole travel: torque against position is its curve";
    case blackbox_direction:
        return "one slow stroke at constant speed over the whole travel, there and back: half the difference of both "
               "ways "
               "is its curve";
    case blackbox_filter:
        return "the same excitation at half the level, with what the controller asks for recorded beside it: what is "
               "linear keeps its shape";
    default:
        return NULL;
    }
}

/// Where what has no name lies most densely, of the axes that say more than the frequency does; false: nowhere.
static bool telling_axis(const struct misfit *misfit, enum misfit_axis_kind *out_axis)
{
    enum misfit_axis_kind axes[misfit_axes];
    size_t count = misfit_is_left(misfit, misfit_extended) ? misfit_order(misfit, misfit_extended, axes) : 0;
    for (size_t i = 0; i < count; i++) {
        *out_axis = axes[i];
        if (axes[i] != misfit_frequency)
            return true;
    }
    return count > 0;
}

void wording_closer(const struct diagnosis *self, char out_text[wording_size])
{
    const char *lead = "To see what has no name", *shape = look_at_shape(self->rest_shape);
    const struct misfit *misfit =
        excess(&self->fitted_misfit) > excess(&self->misfit) ? &self->fitted_misfit : &self->misfit;
    enum misfit_axis_kind axis;
    if (shape) {
        snprintf(out_text, wording_size, "%s: measure %s.", lead, shape);
    } else if (self->rest_in_time) {
        snprintf(out_text, wording_size, "%s: measure %s.", lead, closer_look(misfit_time));
    } else if (telling_axis(misfit, &axis)) {
        char place[wording_size];
        wording_range(self, axis, &misfit->axes[axis].range[misfit_extended], place);
        snprintf(out_text, wording_size, "%s, which lies %.*s: measure %s.", lead, wording_size / 2, place,
                 closer_look(axis));
    } else {
        snprintf(out_text, wording_size,
                 "%s: measure the same again, at half the level and at another place: whether "
                 "it comes back, and what it follows.",
                 lead);
    }
}
