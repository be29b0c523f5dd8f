@head@
#include "@name@.h"

#include <math.h>

static const @name@_state @name@_start = @start@;

@functions@
void @name@_init(@name@_state *state)
{
    *state = @name@_start;
}

@real@ @name@_step(@name@_state *state, @real@ r, @real@ x)
{
    @learn@
    return @give@;
}

void @name@_freeze(@name@_state *state, int frozen)
{
    state->ring.frozen = frozen != 0 ? @one@ : @zero@;
}

@real@ @name@_get_voltage(const @name@_state *state)
{
    return state->ring.voltage;
}

void @name@_get_parameters(const @name@_state *state, @real@ parameters[4])
{
    for (int i = 0; i < 4; ++i) {
        parameters[i] = state->ring.model[i];
    }
}

int @name@_set_parameters(@name@_state *state, const @real@ parameters[4])
{
    @adopt@
}

void @name@_get_limits(const @name@_state *state, @real@ *minimum, @real@ *maximum)
{
    *minimum = state->settings.minimum;
    *maximum = state->settings.maximum;
}

int @name@_set_limits(@name@_state *state, @real@ minimum, @real@ maximum)
{
    if (!(minimum < maximum)) {
        return 0;
    }
    state->settings.minimum = minimum;
    state->settings.maximum = maximum;
    return 1;
}
