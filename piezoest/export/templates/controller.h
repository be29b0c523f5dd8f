@head@
#ifndef @guard@
#define @guard@

#ifdef __cplusplus
extern "C" {
#endif

/* All that changes while the controller runs, by its names in Python; the whole is @name@_state. */
@types@
/* Start, or start anew: before the first step. */
void @name@_init(@name@_state *state);

/* One sample: the next reference r [um] and the displacement x [um] measured after the previous voltage.
 * Returns the voltage [V], within the limits. NaN or infinity in r holds the voltage, in x it is a missing
 * measurement; the first x is not looked at. */
@real@ @name@_step(@name@_state *state, @real@ r, @real@ x);

/* Hold the model (1) or learn on (0). */
void @name@_freeze(@name@_state *state, int frozen);

/* Voltage given out last [V]. */
@real@ @name@_get_voltage(const @name@_state *state);

/* Model in use: @model@, offset [um]. */
void @name@_get_parameters(const @name@_state *state, @real@ parameters[4]);

@change@
int @name@_set_parameters(@name@_state *state, const @real@ parameters[4]);

/* Limits of the voltage [V]. */
void @name@_get_limits(const @name@_state *state, @real@ *minimum, @real@ *maximum);

/* Returns 0, and changes nothing, unless minimum < maximum. */
int @name@_set_limits(@name@_state *state, @real@ minimum, @real@ maximum);

#ifdef __cplusplus
}
#endif

#endif
