#include "@name@.h"
#include <stddef.h>

static @name@_state state;

void begin(void) { @name@_init(&state); }
int anew(@real@ voltage) { return @name@_reset(&state, voltage); }
void many(size_t count, const @real@ *r, const @real@ *u, const @real@ *x, @real@ *voltage)
{
    for (size_t k = 0; k < count; ++k) {
        voltage[k] = @name@_step(&state, r[k]);
        @name@_learn(&state, u[k], x[k]);
    }
}
void show(int *status)
{
    status[0] = @name@_get_stage(&state);
    status[1] = @name@_get_driving(&state);
    status[2] = @name@_get_fault(&state);
}
