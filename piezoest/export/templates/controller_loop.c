#include "@name@.h"
#include <stddef.h>

static @name@_state state;

void begin(void) { @name@_init(&state); }
void one(@real@ r, @real@ x, @real@ *u) { *u = @name@_step(&state, r, x); }
void many(size_t count, const @real@ *r, const @real@ *x, @real@ *u)
{
    for (size_t k = 0; k < count; ++k) {
        u[k] = @name@_step(&state, r[k], x[k]);
    }
}
void hold(int frozen) { @name@_freeze(&state, frozen); }
void get(@real@ *parameters) { @name@_get_parameters(&state, parameters); }
int set(const @real@ *parameters) { return @name@_set_parameters(&state, parameters); }
int limit(@real@ minimum, @real@ maximum) { return @name@_set_limits(&state, minimum, maximum); }
