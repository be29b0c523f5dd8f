@head@
#ifndef @guard@
#define @guard@

#ifdef __cplusplus
extern "C" {
#endif

/* All that changes while the controller runs, by its names in Python; the whole is @name@_state. */
@types@
/* Go on from where the controller was exported: before the first step. */
void @name@_init(@name@_state *state);

/* Begin anew, knowing nothing, with the stage at rest at a voltage [V]. Returns 0, and changes nothing,
 * unless it is within the limits, @limits@. */
int @name@_reset(@name@_state *state, @real@ voltage);

/* Go on with all that was learnt, with the stage at rest at a voltage [V] where the sensor reads a displacement
 * [um], as after a start of the board. Returns 0, and changes nothing, unless the voltage is within the limits
 * and the displacement a number. */
int @name@_resume(@name@_state *state, @real@ voltage, @real@ displacement);

/* Voltage [V], within the limits, for the next sample of the reference r [um]; NaN or infinity holds the last
 * one. */
@real@ @name@_step(@name@_state *state, @real@ r);

/* Learn from the voltage u [V] that was written and the displacement x [um] measured then, NaN where there is
 * none, or nobody knows what was written: once after each step. */
void @name@_learn(@name@_state *state, @real@ u, @real@ x);

/* Begin a sweep of the voltage that erases what hysteresis remembers: from an amplitude [V], at a frequency
 * [Hz], within so many cycles, to nothing; the steps ignore the reference meanwhile. Returns 0, and changes
 * nothing, if the amplitude is above half the range, or a number is out of range. */
int @name@_home(@name@_state *state, @real@ amplitude, @real@ frequency, @real@ cycles);

/* Voltage given out last [V]. */
@real@ @name@_get_voltage(const @name@_state *state);

/* Stage of the work: @stages@. */
int @name@_get_stage(const @name@_state *state);

/* Model that drives: @models@. */
int @name@_get_driving(const @name@_state *state);

/* Fault of the readings: @faults@.
 * Other events are no faults: state->noticed counts all, and state->notice is the number of the last one,
 * 0 at the end of a fault:
 * @events@. */
int @name@_get_fault(const @name@_state *state);

#ifdef __cplusplus
}
#endif

#endif
