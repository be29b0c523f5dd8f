/* A control loop for a generic board: a timer calls loop_step() once per sample; the rest is for the host.
 *
 * A board must supply the three functions below: two converters and the reference. On a board they access
 * registers. Here, on the host, they read and write a log, so that the same loop can be compared with the
 * library (check.py). */
#include "piezoest_controller.h"

#include <math.h>
#include <stdio.h>

#ifndef REAL
#define REAL double
#endif

/* ------------------------------------------------------------------ the board */

static REAL read_sensor(void);       /* displacement [um]; NAN if there is none */
static REAL next_reference(void);    /* next value of the reference [um] */
static void write_voltage(REAL u);   /* to the amplifier [V] */

/* ------------------------------------------------------------------ the loop */

static piezoest_controller_state controller;

/* Number of successive samples with too large an error. */
static int strikes;

enum { MOST_STRIKES = 100 };
static const REAL LARGEST_ERROR = (REAL)2.0; /* um */

static void loop_start(void)
{
    piezoest_controller_init(&controller);
    write_voltage(piezoest_controller_get_voltage(&controller));
}

/* Called by the timer once per sample. It first reads the measurement that belongs to the previous voltage. */
static void loop_step(void)
{
    static REAL wanted;
    const REAL x = read_sensor();
    const REAL error = (REAL)fabs((double)(wanted - x));

    /* Where the stage does not follow for a while, something is wrong with it and not with the model:
     * hold the model until it follows again. NAN compares as false. */
    strikes = error > LARGEST_ERROR ? strikes + 1 : 0;
    piezoest_controller_freeze(&controller, strikes > MOST_STRIKES);

    wanted = next_reference();
    write_voltage(piezoest_controller_step(&controller, wanted, x));
}

/* ------------------------------------------------------------------ the host in the place of the board */

static double log_r, log_x;

static REAL read_sensor(void) { return (REAL)log_x; }
static REAL next_reference(void) { return (REAL)log_r; }
static void write_voltage(REAL u) { printf("%.17g\n", (double)u); }

int main(void)
{
    REAL parameters[4];

    loop_start();
    /* Lines of "r x", x measured before r is given; "nan" for no measurement. */
    while (scanf("%lf %lf", &log_r, &log_x) == 2) {
        loop_step();
    }
    piezoest_controller_get_parameters(&controller, parameters);
    for (int i = 0; i < 4; ++i) {
        fprintf(stderr, "%.17g\n", (double)parameters[i]);
    }
    return 0;
}
