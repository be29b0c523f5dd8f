/* FMI 2.0 for co-simulation around the controller in @name@.c: one sample a step of 1/sample_rate seconds.
 * Declarations after the Functional Mock-up Interface 2.0.4, sec. 2.1.4 to 4.2. */
#include "@name@.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef const fmi2Char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef int fmi2StatusKind;
typedef struct {
    void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

#define GUID "@guid@"
#define SAMPLE_RATE @sample_rate@

/* Value references; modelDescription.xml has the same. */
enum { REFERENCE, MEASUREMENT, VOLTAGE, MINIMUM, MAXIMUM, PARAMETERS, REALS = PARAMETERS + 4 };

typedef struct {
    @name@_state controller;
    double reference, measurement, voltage;
    int frozen;
} contents;

typedef struct {
    contents now;
    fmi2CallbackFunctions callbacks;
    char name[128];
} instance;

static fmi2Status complain(const instance *self, const char *text)
{
    if (self->callbacks.logger != NULL) {
        self->callbacks.logger(self->callbacks.componentEnvironment, self->name, fmi2Error, "logStatusError", text);
    }
    return fmi2Error;
}

static void start(contents *now)
{
    memset(now, 0, sizeof *now);
    @name@_init(&now->controller);
    now->measurement = NAN;
    now->voltage = (double)@name@_get_voltage(&now->controller);
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    (void)c, (void)on, (void)count, (void)categories;
    return fmi2OK;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources, (void)visible, (void)logging;
    if (type != fmi2CoSimulation || guid == NULL || strcmp(guid, GUID) != 0 || callbacks == NULL) {
        return NULL;
    }
    instance *self = calloc(1, sizeof *self);
    if (self == NULL) {
        return NULL;
    }
    self->callbacks = *callbacks;
    snprintf(self->name, sizeof self->name, "%s", name == NULL ? "" : name);
    start(&self->now);
    return self;
}

EXPORT void fmi2FreeInstance(fmi2Component c) { free(c); }

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean given, fmi2Real tolerance, fmi2Real from,
                                      fmi2Boolean ends, fmi2Real to)
{
    (void)c, (void)given, (void)tolerance, (void)from, (void)ends, (void)to;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
EXPORT fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return fmi2OK; }
EXPORT fmi2Status fmi2Reset(fmi2Component c) { start(&((instance *)c)->now); return fmi2OK; }

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t count, fmi2Real value[])
{
    const instance *self = c;
    @real@ minimum, maximum, parameters[4];

    @name@_get_limits(&self->now.controller, &minimum, &maximum);
    @name@_get_parameters(&self->now.controller, parameters);
    for (size_t i = 0; i < count; ++i) {
        switch (vr[i]) {
        case REFERENCE: value[i] = self->now.reference; break;
        case MEASUREMENT: value[i] = self->now.measurement; break;
        case VOLTAGE: value[i] = self->now.voltage; break;
        case MINIMUM: value[i] = (double)minimum; break;
        case MAXIMUM: value[i] = (double)maximum; break;
        default:
            if (vr[i] >= REALS) {
                return complain(self, "fmi2GetReal: no such variable");
            }
            value[i] = (double)parameters[vr[i] - PARAMETERS];
        }
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2Real value[])
{
    instance *self = c;
    @real@ minimum, maximum;

    @name@_get_limits(&self->now.controller, &minimum, &maximum);
    for (size_t i = 0; i < count; ++i) {
        switch (vr[i]) {
        case REFERENCE: self->now.reference = value[i]; break;
        case MEASUREMENT: self->now.measurement = value[i]; break;
        case MINIMUM: minimum = (@real@)value[i]; break;
        case MAXIMUM: maximum = (@real@)value[i]; break;
        default: return complain(self, "fmi2SetReal: this variable cannot be set");
        }
    }
    if (!@name@_set_limits(&self->now.controller, minimum, maximum)) {
        return complain(self, "minimum must be below maximum");
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t count, fmi2Boolean value[])
{
    const instance *self = c;

    for (size_t i = 0; i < count; ++i) {
        if (vr[i] != 0) {
            return complain(self, "fmi2GetBoolean: no such variable");
        }
        value[i] = self->now.frozen;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t count,
                                 const fmi2Boolean value[])
{
    instance *self = c;

    for (size_t i = 0; i < count; ++i) {
        if (vr[i] != 0) {
            return complain(self, "fmi2SetBoolean: no such variable");
        }
        self->now.frozen = value[i] != 0;
        @name@_freeze(&self->now.controller, self->now.frozen);
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real at, fmi2Real step, fmi2Boolean no_return)
{
    instance *self = c;
    const double samples = step * SAMPLE_RATE, whole = floor(samples + 0.5);

    (void)at, (void)no_return;
    if (!(whole >= 1.0) || fabs(samples - whole) > 1e-6 * whole) {
        return complain(self, "the step must be a whole number of samples of 1/sample_rate");
    }
    for (double k = 0.0; k < whole; k += 1.0) {
        self->now.voltage =
            (double)@name@_step(&self->now.controller, (@real@)self->now.reference, (@real@)self->now.measurement);
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2CancelStep(fmi2Component c) { return complain(c, "steps are not asynchronous"); }

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    if (*state == NULL) {
        *state = calloc(1, sizeof(contents));
    }
    if (*state == NULL) {
        return complain(c, "out of memory");
    }
    memcpy(*state, &((instance *)c)->now, sizeof(contents));
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    memcpy(&((instance *)c)->now, state, sizeof(contents));
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c, (void)state;
    *size = sizeof(contents);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    if (size < sizeof(contents)) {
        return complain(c, "fmi2SerializeFMUstate: too few bytes");
    }
    memcpy(bytes, state, sizeof(contents));
    return fmi2OK;
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    if (size != sizeof(contents)) {
        return complain(c, "fmi2DeSerializeFMUstate: bytes of another size");
    }
    if (fmi2GetFMUstate(c, state) != fmi2OK) {
        return fmi2Error;
    }
    memcpy(*state, bytes, size);
    return fmi2OK;
}

/* What this unit has none of: whole numbers, text, derivatives, pending steps. */
#define EMPTY(name, type) \
    EXPORT fmi2Status name(fmi2Component c, const fmi2ValueReference vr[], size_t count, type value[]) \
    { (void)vr, (void)value; return count == 0 ? fmi2OK : complain(c, #name ": no such variable"); }
EMPTY(fmi2GetInteger, fmi2Integer)
EMPTY(fmi2SetInteger, const fmi2Integer)
EMPTY(fmi2GetString, fmi2String)
EMPTY(fmi2SetString, const fmi2String)
EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t unknowns,
                                               const fmi2ValueReference known[], size_t knowns, const fmi2Real by[],
                                               fmi2Real of[])
{
    (void)unknown, (void)unknowns, (void)known, (void)knowns, (void)by, (void)of;
    return complain(c, "there are no derivatives");
}
EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t count,
                                              const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr, (void)order, (void)value;
    return count == 0 ? fmi2OK : complain(c, "there are no derivatives");
}
EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t count,
                                               const fmi2Integer order[], fmi2Real value[])
{
    (void)vr, (void)order, (void)value;
    return count == 0 ? fmi2OK : complain(c, "there are no derivatives");
}
#define STATUS(name, type) \
    EXPORT fmi2Status name(fmi2Component c, const fmi2StatusKind kind, type *value) \
    { (void)kind, (void)value; return complain(c, "steps are not asynchronous"); }
STATUS(fmi2GetStatus, fmi2Status)
STATUS(fmi2GetRealStatus, fmi2Real)
STATUS(fmi2GetIntegerStatus, fmi2Integer)
STATUS(fmi2GetBooleanStatus, fmi2Boolean)
STATUS(fmi2GetStringStatus, fmi2String)
