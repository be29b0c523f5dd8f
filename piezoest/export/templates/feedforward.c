@head@
#include "@name@.h"

#include <math.h>

static const @name@_state start_state = @start@;
@begun@
@functions@
void @name@_init(@name@_state *state)
{
    *state = start_state;
}

int @name@_reset(@name@_state *state, @real@ voltage)
{
    if (!(voltage >= @minimum@ && voltage <= @maximum@)) {
        return 0;
    }
    *state = @anew@_state;
    @begin@;
    return 1;
}

int @name@_resume(@name@_state *state, @real@ voltage, @real@ displacement)
{
    return @resume@;
}

@real@ @name@_step(@name@_state *state, @real@ r)
{
    return @step@;
}

void @name@_learn(@name@_state *state, @real@ u, @real@ x)
{
    @learn@;
}

int @name@_home(@name@_state *state, @real@ amplitude, @real@ frequency, @real@ cycles)
{
    return @home@;
}

@real@ @name@_get_voltage(const @name@_state *state)
{
    return state->planned;
}

int @name@_get_stage(const @name@_state *state)
{
    return (int)state->stage;
}

int @name@_get_driving(const @name@_state *state)
{
    return (int)state->driving;
}

int @name@_get_fault(const @name@_state *state)
{
    return (int)@fault@;
}
