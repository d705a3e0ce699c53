/* The same pendulum as an FMU of FMI 3. */
#include <stdbool.h>
#include "pendulum.c"
typedef const char *Text;
void *fmi3InstantiateModelExchange(Text n, Text k, Text r, bool v, bool l, void *e, void *f) {
  return fmi2Instantiate(n, 0, k, r, f, v, l);
}
void *fmi3InstantiateCoSimulation(
    Text n, Text k, Text r, bool v, bool l, bool m, bool y, const unsigned *q, size_t nq, void *e, void *f, void *i) {
  return fmi2Instantiate(n, 1, k, r, f, v, l);
}
void fmi3FreeInstance(void *c) { fmi2FreeInstance(c); }
int fmi3EnterInitializationMode(void *c, bool td, double t, double s, bool sd, double e) { ((Copy*)c)->v[8] = s; return 0; }
int fmi3ExitInitializationMode(void *c) { return 0; }
int fmi3EnterEventMode(void *c) { return 0; }
int fmi3EnterContinuousTimeMode(void *c) { return 0; }
int fmi3Terminate(void *c) { return 0; }
int fmi3Reset(void *c) { return fmi2Reset(c); }
int fmi3SetFloat64(void *c, const unsigned *r, size_t n, const double *v, size_t nv) { return fmi2SetReal(c, r, n, v); }
int fmi3GetFloat64(void *c, const unsigned *r, size_t n, double *v, size_t nv) { return fmi2GetReal(c, r, n, v); }
int fmi3SetTime(void *c, double t) { ((Copy*)c)->v[8] = t; return 0; }
int fmi3SetContinuousStates(void *c, const double *x, size_t n) { return fmi2SetContinuousStates(c, x, n); }
int fmi3GetContinuousStates(void *c, double *x, size_t n) { return fmi2GetContinuousStates(c, x, n); }
int fmi3GetContinuousStateDerivatives(void *c, double *d, size_t n) { return fmi2GetDerivatives(c, d, n); }
int fmi3GetEventIndicators(void *c, double *z, size_t n) { return fmi2GetEventIndicators(c, z, n); }
int fmi3UpdateDiscreteStates(void *c, bool *more, bool *stop, bool *nominals, bool *values, bool *timed, double *next) {
  *more = *stop = *nominals = *timed = false;
  *values = bounce(c);
  return 0;
}
int fmi3DoStep(void *c, double t, double h, bool k, bool *event, bool *stop, bool *early, double *last) {
  *event = *stop = *early = false;
  fmi2DoStep(c, t, h, k);
#ifdef INTERNAL
  h = INTERNAL*floor(h/INTERNAL + 1e-9);
#endif
  *last = ((Copy*)c)->v[8] = t + h;
  return STATUS;
}

/* What a library must have, though nobody calls it here. */
#define NONE(name) int name(void) { return 3; }
NONE(fmi3ActivateModelPartition) NONE(fmi3CompletedIntegratorStep) NONE(fmi3DeserializeFMUState)
NONE(fmi3EnterConfigurationMode) NONE(fmi3EnterStepMode) NONE(fmi3EvaluateDiscreteStates)
NONE(fmi3ExitConfigurationMode) NONE(fmi3FreeFMUState) NONE(fmi3GetAdjointDerivative) NONE(fmi3GetBinary)
NONE(fmi3GetBoolean) NONE(fmi3GetClock) NONE(fmi3GetDirectionalDerivative) NONE(fmi3GetFMUState) NONE(fmi3GetFloat32)
NONE(fmi3GetInt16) NONE(fmi3GetInt32) NONE(fmi3GetInt64) NONE(fmi3GetInt8) NONE(fmi3GetIntervalDecimal)
NONE(fmi3GetIntervalFraction) NONE(fmi3GetNominalsOfContinuousStates) NONE(fmi3GetNumberOfContinuousStates)
NONE(fmi3GetNumberOfEventIndicators) NONE(fmi3GetNumberOfVariableDependencies) NONE(fmi3GetOutputDerivatives)
NONE(fmi3GetShiftDecimal) NONE(fmi3GetShiftFraction) NONE(fmi3GetString) NONE(fmi3GetUInt16) NONE(fmi3GetUInt32)
NONE(fmi3GetUInt64) NONE(fmi3GetUInt8) NONE(fmi3GetVariableDependencies) NONE(fmi3GetVersion)
NONE(fmi3InstantiateScheduledExecution) NONE(fmi3SerializeFMUState) NONE(fmi3SerializedFMUStateSize)
NONE(fmi3SetBinary) NONE(fmi3SetBoolean) NONE(fmi3SetClock) NONE(fmi3SetDebugLogging) NONE(fmi3SetFMUState)
NONE(fmi3SetFloat32) NONE(fmi3SetInt16) NONE(fmi3SetInt32) NONE(fmi3SetInt64) NONE(fmi3SetInt8)
NONE(fmi3SetIntervalDecimal) NONE(fmi3SetIntervalFraction) NONE(fmi3SetShiftDecimal) NONE(fmi3SetShiftFraction)
NONE(fmi3SetString) NONE(fmi3SetUInt16) NONE(fmi3SetUInt32) NONE(fmi3SetUInt64) NONE(fmi3SetUInt8)
