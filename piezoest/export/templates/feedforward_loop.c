#include "@name@.h"

static @name@_state state;

void begin(void) { @name@_init(&state); }
int anew(@real@ voltage) { return @name@_reset(&state, voltage); }
int resume(@real@ voltage, @real@ displacement) { return @name@_resume(&state, voltage, displacement); }
@real@ step(@real@ r) { return @name@_step(&state, r); }
void learn(@real@ u, @real@ x) { @name@_learn(&state, u, x); }
int home(@real@ amplitude, @real@ frequency, @real@ cycles)
{
    return @name@_home(&state, amplitude, frequency, cycles);
}
void show(int *status)
{
    status[0] = @name@_get_stage(&state);
    status[1] = @name@_get_driving(&state);
    status[2] = @name@_get_fault(&state);
}
