/* A pendulum as an FMU of FMI 2, for model exchange and co-simulation (steps of Euler, 0.1 ms):
   th' = w, w' = (u + f - b w)/m - 9.81 sin(th).
   With -DWALL=a a wall stands at th = a, from which it bounces with half its speed, an event.
   With -DINTERNAL=h co-simulation makes whole steps of h s only, as solvers of a fixed step do.
   With -DGRAVITY=0 it swings in a plane without weight. With -DSTATUS=s derivatives and steps return the status s, with -DRESET=s resets. */
#include <stdlib.h>
#include <math.h>
#ifndef GRAVITY
#define GRAVITY 9.81
#endif
#ifndef STATUS
#define STATUS 0
#endif
#ifndef RESET
#define RESET 0
#endif
typedef struct { double v[10]; } Copy; /* th, w, der(th), der(w), u, f, m, b; of FMI 3 time and the way to the wall, too */
static void rates(Copy *c) {
  c->v[2] = c->v[1];
  c->v[3] = (c->v[4] + c->v[5] - c->v[7]*c->v[1])/c->v[6] - GRAVITY*sin(c->v[0]);
#ifdef WALL
  c->v[9] = WALL - c->v[0];
#endif
}
static void start(Copy *c) { for (int i = 0; i < 10; i++) c->v[i] = 0; c->v[6] = 0.8; c->v[7] = 0.2; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *n, int t, const char *g, const char *r, const void *f, int v, int l) {
  Copy *c = malloc(sizeof(Copy)); start(c); return c;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int td, double t, double s, int sd, double e) { return 0; }
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) { return 0; }
int fmi2Terminate(void *c) { return 0; }
int fmi2Reset(void *c) { start(c); return RESET; }
int fmi2SetReal(void *c, const unsigned *r, size_t n, const double *v) {
  for (size_t i = 0; i < n; i++) ((Copy*)c)->v[r[i]] = v[i];
  return 0;
}
int fmi2GetReal(void *c, const unsigned *r, size_t n, double *v) {
  rates(c);
  for (size_t i = 0; i < n; i++) v[i] = ((Copy*)c)->v[r[i]];
  return 0;
}
typedef struct { int more, stop, nominals, values, timed; double next; } Event;
static int bounce(Copy *c) {
#ifdef WALL
  if (c->v[0] >= WALL && c->v[1] > 0) { c->v[1] *= -0.5; return 1; }
#endif
  return 0;
}
int fmi2NewDiscreteStates(void *c, Event *e) {
  Event none = {0};
  *e = none;
  e->values = bounce(c);
  return 0;
}
int fmi2GetEventIndicators(void *c, double *z, size_t n) {
#ifdef WALL
  for (size_t i = 0; i < n; i++) z[i] = WALL - ((Copy*)c)->v[0];
#endif
  return 0;
}
int fmi2GetContinuousStates(void *c, double *x, size_t n) {
  for (size_t i = 0; i < n; i++) x[i] = ((Copy*)c)->v[i];
  return 0;
}
int fmi2CompletedIntegratorStep(void *c, int k, int *e, int *t) { *e = *t = 0; return 0; }
int fmi2EnterEventMode(void *c) { return 0; }
int fmi2EnterContinuousTimeMode(void *c) { return 0; }
int fmi2SetTime(void *c, double t) { return 0; }
int fmi2SetContinuousStates(void *c, const double *x, size_t n) {
  for (size_t i = 0; i < n; i++) ((Copy*)c)->v[i] = x[i];
  return 0;
}
int fmi2GetDerivatives(void *c, double *d, size_t n) {
  rates(c);
  for (size_t i = 0; i < n; i++) d[i] = ((Copy*)c)->v[2 + i];
  return STATUS;
}
int fmi2DoStep(void *c, double t, double h, int k) {
  Copy *p = c;
#ifdef INTERNAL
  h = INTERNAL*floor(h/INTERNAL + 1e-9);
#endif
  int steps = (int)ceil(h/1e-4 - 1e-9);
  for (int i = 0; i < steps; i++) {
    rates(p);
    p->v[1] += h/steps*p->v[3];
    p->v[0] += h/steps*p->v[1];
    bounce(p);
  }
  return STATUS;
}

/* What a library must have, though nobody calls it here. */
int fmi2SetDebugLogging(void) { return 3; }
int fmi2GetInteger(void) { return 3; }
int fmi2GetBoolean(void) { return 3; }
int fmi2GetString(void) { return 3; }
int fmi2SetInteger(void) { return 3; }
int fmi2SetBoolean(void) { return 3; }
int fmi2SetString(void) { return 3; }
int fmi2GetFMUstate(void) { return 3; }
int fmi2SetFMUstate(void) { return 3; }
int fmi2FreeFMUstate(void) { return 3; }
int fmi2SerializedFMUstateSize(void) { return 3; }
int fmi2SerializeFMUstate(void) { return 3; }
int fmi2DeSerializeFMUstate(void) { return 3; }
int fmi2GetDirectionalDerivative(void) { return 3; }
int fmi2GetNominalsOfContinuousStates(void) { return 3; }
int fmi2SetRealInputDerivatives(void) { return 3; }
int fmi2GetRealOutputDerivatives(void) { return 3; }
int fmi2CancelStep(void) { return 3; }
int fmi2GetStatus(void) { return 3; }
int fmi2GetRealStatus(void) { return 3; }
int fmi2GetIntegerStatus(void) { return 3; }
int fmi2GetBooleanStatus(void) { return 3; }
int fmi2GetStringStatus(void) { return 3; }
