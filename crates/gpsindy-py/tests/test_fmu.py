"""FMUs as the nominal model: one of FMI 2 that the test builds itself, where a compiler is at hand."""

from __future__ import annotations

import shutil
import subprocess
import zipfile

import numpy as np
import pytest

import gpsindy

pytest.importorskip("fmpy")

# A pendulum: th' = w, w' = (u + f - b w)/m - 9.81 sin(th); model exchange and co-simulation (steps of Euler, 0.1 ms).
SOURCE = r"""
#include <stdlib.h>
#include <math.h>
typedef struct { double v[8]; } Copy; /* th, w, der(th), der(w), u, f, m, b */
static void rates(Copy *c) {
  c->v[2] = c->v[1];
  c->v[3] = (c->v[4] + c->v[5] - c->v[7]*c->v[1])/c->v[6] - 9.81*sin(c->v[0]);
}
static void start(Copy *c) { for (int i = 0; i < 8; i++) c->v[i] = 0; c->v[6] = 0.8; c->v[7] = 0.2; }
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
int fmi2Reset(void *c) { start(c); return 0; }
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
int fmi2NewDiscreteStates(void *c, Event *e) { Event none = {0}; *e = none; return 0; }
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
  return 0;
}
int fmi2DoStep(void *c, double t, double h, int k) {
  Copy *p = c;
  int steps = (int)ceil(h/1e-4 - 1e-9);
  for (int i = 0; i < steps; i++) { rates(p); p->v[1] += h/steps*p->v[3]; p->v[0] += h/steps*p->v[1]; }
  return 0;
}
"""

# What a library must have, though nobody calls it here.
UNUSED = """SetDebugLogging GetInteger GetBoolean GetString SetInteger SetBoolean SetString GetFMUstate SetFMUstate
FreeFMUstate SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate GetDirectionalDerivative GetEventIndicators
GetContinuousStates GetNominalsOfContinuousStates SetRealInputDerivatives GetRealOutputDerivatives CancelStep GetStatus
GetRealStatus GetIntegerStatus GetBooleanStatus GetStringStatus""".split()

VARIABLES = [
    ("th", "local", "continuous", "exact", 'start="0"'),
    ("w", "local", "continuous", "exact", 'start="0"'),
    ("der(th)", "local", "continuous", "calculated", 'derivative="1"'),
    ("der(w)", "local", "continuous", "calculated", 'derivative="2"'),
    ("u", "input", "continuous", None, 'start="0"'),
    ("f", "input", "continuous", None, 'start="0"'),
    ("m", "parameter", "fixed", "exact", 'start="0.8" min="0.01"'),
    ("b", "parameter", "fixed", "exact", 'start="0.2" min="0"'),
]


def description() -> str:
    lines = []
    for reference, (name, causality, variability, initial, real) in enumerate(VARIABLES):
        said = f' initial="{initial}"' if initial else ""
        lines.append(
            f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" '
            f'variability="{variability}"{said}><Real {real}/></ScalarVariable>'
        )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="pendulum" guid="{{1}}" numberOfEventIndicators="0">
<ModelExchange modelIdentifier="pendulum"/><CoSimulation modelIdentifier="pendulum"/>
<DefaultExperiment startTime="0" stopTime="10" stepSize="0.005"/>
<ModelVariables>{"".join(lines)}</ModelVariables>
<ModelStructure><Derivatives><Unknown index="3"/><Unknown index="4"/></Derivatives>
<InitialUnknowns><Unknown index="3"/><Unknown index="4"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>"""


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory):
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    from fmpy import platform

    folder = tmp_path_factory.mktemp("fmu")
    (folder / "pendulum.c").write_text(SOURCE + "".join(f"int fmi2{name}(void) {{ return 3; }}\n" for name in UNUSED))
    library = folder / "pendulum.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O2", "-o", library, folder / "pendulum.c", "-lm"], check=True)
    path = folder / "pendulum.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description())
        archive.write(library, f"binaries/{platform}/pendulum.so")
    return path


EQUATIONS = """
schema = "gpsindy.model/1"
[[state]]
name = "th"
equation = "w"
[[state]]
name = "w"
equation = "(u - b*w)/m - 9.81*sin(th)"
[[control]]
name = "u"
[[parameter]]
name = "m"
value = 0.8
[[parameter]]
name = "b"
value = 0.2
"""


def command(seed: int):
    rng = np.random.default_rng(seed)
    t = np.arange(0, 4, 0.02)
    return t, sum(rng.uniform(1, 3) * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in (0.3, 0.7, 1.1))


@pytest.mark.parametrize(("kind", "tolerance"), [("model exchange", 1e-6), ("co-simulation", 2e-3)])
def test_a_rollout_is_that_of_the_same_equations(pendulum, kind, tolerance):
    from gpsindy import fmu

    t, u = command(1)
    t, u = t[:60], u[:60]
    found = fmu.Simulator(pendulum, kind=kind, kinematic={"th": "w"}, forces={"f": "w"}).model.simulate([0.3, 0.0], t, u=u[:, None])
    same = gpsindy.Model.from_toml(EQUATIONS).simulate([0.3, 0.0], t, u=u[:, None])
    assert np.abs(found.x - same.x).max() < tolerance


def test_dry_friction_at_a_force_input_is_found_there(pendulum, tmp_path):
    from gpsindy import fmu

    truth = gpsindy.Model.from_toml(EQUATIONS.replace("- b*w", "- b*w - 0.5*tanh(w/0.002)"))
    rng = np.random.default_rng(3)
    logs = []
    for seed in range(2):
        t, u = command(seed)
        x = truth.simulate([0.0, 0.0], t, u=u[:, None]).x
        logs.append({"t": t, "th": x[:, 0] + 1e-3 * rng.standard_normal(len(t)), "u": u})
    simulator = fmu.Simulator(pendulum, kinematic={"th": "w"}, forces={"f": ("w", "th")}, dt=0.02)
    found = gpsindy.diagnose(
        simulator, logs, effects=["coulomb_friction", "bias"], most_effects=1, hold="zero"
    )
    assert [(c.effect, c.place) for c in found.included] == [("coulomb_friction", "f")]
    found.augmented.save(tmp_path / "augmented.ssv")
    assert "f" in (tmp_path / "augmented.ssv").read_text()
