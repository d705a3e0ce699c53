"""Time of the paper's pipeline and of its parts beside what others offer for them, one thread each, in one run.

    target/venv/bin/python benches/peers.py [REPEATS] [pipeline] [engines] [rollouts]

pipeline: Lotka-Volterra as in the paper, section V-A: 240 samples of 2 states, one every 0.1 s, noise 0.05.

- smoothing: a Gaussian process over time a state, of five kernels that of the lowest negative log likelihood;
- identification: smoothing, a second Gaussian process from smoothed states to derivatives (four kernels), and LASSO by
  cross-validation over polynomials of degree 3, sines and cosines.

scikit-learn optimises each kernel from one start (its default) and from two; the package ranks a list of starts and
optimises from the best two, unless they are alike. scikit-learn does not offer the derivative of a process, so
differences of the smoothed states stand in. Errors are root mean squares against the true states or the true
derivatives: a fast answer counts only when it is as good.

engines: one likelihood with gradient. Dense (squared exponential) beside LAPACK's factorisation and inverse alone
(potrf, potri; building the matrix and the traces are not charged to it); Toeplitz beside our dense; the state space of
Matern 5/2 by the point. Needs `cargo build --release -p gpsindy-core --example likelihood`.

rollouts: `Model.simulate` beside `pysindy.SINDy.simulate`, the same equations, the same accuracy.

The sides take turns; times are medians of elapsed seconds, and the ratio of processor time suffers less from a busy
machine. Needs scikit-learn, which the environment of `cargo xtask python` has, and pysindy for the rollouts.
"""

import os
import resource
import subprocess
import sys
import warnings
from pathlib import Path

CPU = Path("/proc/cpuinfo")
os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", RAYON_NUM_THREADS="1")
if CPU.exists() and "avx512f" in CPU.read_text():
    # A virtual machine that hides its model gets slower kernels from OpenBLAS than it could have.
    os.environ.setdefault("OPENBLAS_CORETYPE", "SkylakeX")

from itertools import product  # noqa: E402
from statistics import median  # noqa: E402
from time import perf_counter, process_time, thread_time  # noqa: E402

import numpy as np  # noqa: E402
import scipy  # noqa: E402
import sklearn  # noqa: E402
import threadpoolctl  # noqa: E402
from scipy.integrate import solve_ivp  # noqa: E402
from scipy.linalg import lapack  # noqa: E402
from sklearn.gaussian_process import GaussianProcessRegressor, kernels  # noqa: E402
from sklearn.linear_model import LassoCV  # noqa: E402
from sklearn.pipeline import make_pipeline  # noqa: E402
from sklearn.preprocessing import PolynomialFeatures, StandardScaler  # noqa: E402

import gpsindy  # noqa: E402

N_SAMPLES, STEP, NOISE, SEED = 240, 0.1, 0.05, 0


def rate(x):
    """Derivatives of prey and predators, (r x 2)."""
    both = 0.4 * x[:, 0] * x[:, 1]
    return np.column_stack([1.1 * x[:, 0] - both, both - x[:, 1]])


def library(x):
    return np.hstack([PolynomialFeatures(3, include_bias=False).fit_transform(x), np.sin(x), np.cos(x)])


def posterior_mean(inputs, targets, n_starts):
    """Mean at the samples by the kernel of the lowest negative log likelihood; the periodic one is for time only."""
    ones = np.ones(inputs.shape[1])
    shapes = [kernels.RBF(ones), kernels.Matern(ones, nu=2.5), kernels.Matern(ones, nu=1.5), kernels.RationalQuadratic()]
    if inputs.shape[1] == 1:
        shapes.append(kernels.ExpSineSquared())
    settings = {"normalize_y": True, "n_restarts_optimizer": n_starts - 1, "random_state": SEED}
    wholes = [kernels.ConstantKernel() * shape + kernels.WhiteKernel() for shape in shapes]
    fits = [GaussianProcessRegressor(whole, **settings).fit(inputs, targets) for whole in wholes]
    return max(fits, key=lambda fit: fit.log_marginal_likelihood_value_).predict(inputs)


def their_smoothing(t, y, n_starts):
    return np.column_stack([posterior_mean(t[:, None], column, n_starts) for column in y.T])


def their_identification(t, y, n_starts):
    x = their_smoothing(t, y, n_starts)
    smoothed = [posterior_mean(x, column, n_starts) for column in np.gradient(x, t, axis=0).T]
    theta = library(x)
    return [make_pipeline(StandardScaler(), LassoCV(cv=5)).fit(theta, column) for column in smoothed]


def our_smoothing(t, y):
    return gpsindy.smooth({"t": t, "x1": y[:, 0], "x2": y[:, 1]}).runs[0].x


def our_identification(t, y):
    return gpsindy.GPSINDy.paper(trig=True).fit(y, t)


def timed(work, *data):
    """The result, elapsed seconds and seconds of the processor."""
    clock, processor = perf_counter(), process_time()
    result = work(*data)
    return result, perf_counter() - clock, process_time() - processor


def rms(found, truth):
    return float(np.sqrt(np.mean((found - truth) ** 2)))


LIKELIHOOD = Path(__file__).parent.parent / "target" / "release" / "examples" / "likelihood"


def lapack_time(n):
    """Seconds of the processor for one factorisation and inverse."""
    lags = STEP * np.subtract.outer(np.arange(n), np.arange(n))
    # As in our engine what is below e^-200 is 0: denormal numbers would slow LAPACK threefold.
    signal = np.exp(np.maximum(-0.5 * lags**2, -200.0)) * (0.5 * lags**2 < 200.0)
    matrix = np.asfortranarray(signal + np.exp(-4.0) * np.eye(n))
    start = thread_time()
    factor, _ = lapack.dpotrf(matrix, lower=1, clean=0, overwrite_a=1)
    lapack.dpotri(factor, lower=1, overwrite_c=1)
    return thread_time() - start


def our_time(engine, n, times):
    """Seconds of the processor for one likelihood with gradient: `times` + 1 of them less one."""

    def spent(count):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([LIKELIHOOD, engine, str(n), str(count)], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    return (spent(times + 1) - spent(1)) / times


PARTS = ("uniform", "irregular", "smooth-uniform", "smooth")


def engines(repeats):
    print(f"{'likelihood and gradient, ms':30}{'LAPACK':>10}{'dense':>10}{'Toeplitz':>10}{'dense/LAPACK':>14}{'dense/Toeplitz':>16}")
    for n in (300, 1000, 3000):
        times = max(1, 10**9 // n**3 * 3)
        turns = [
            (median(lapack_time(n) for _ in range(min(times, 9))), our_time("dense", n, times), our_time("toeplitz", n, 20 * times))
            for _ in range(repeats)
        ]
        theirs, dense, toeplitz = (1e3 * median(turn[k] for turn in turns) for k in range(3))
        ratios = [median(turn[1] / turn[k] for turn in turns) for k in (0, 2)]
        print(f"{f'n = {n}':30}{theirs:10.3f}{dense:10.3f}{toeplitz:10.4f}{ratios[0]:14.2f}{ratios[1]:16.1f}", flush=True)
    print(f"{'Matern 5/2, ns a point':30}{'uniform':>10}{'irregular':>10}{'smoothing: uniform':>20}{'irregular':>10}")
    for n in (1000, 10_000, 100_000, 1_000_000):
        times = max(3, 3_000_000 // n)
        found = [median(our_time(what, n, times) for _ in range(repeats)) / n for what in PARTS]
        print(f"{f'n = {n}':30}" + "".join(f"{1e9 * f:{width}.1f}" for f, width in zip(found, (10, 10, 20, 10))), flush=True)


def rollouts(repeats, t, true):
    try:
        import pysindy
    except ImportError:
        print("rollouts: pysindy is not installed here")
        return
    theirs = pysindy.SINDy(feature_library=pysindy.PolynomialLibrary(degree=2), optimizer=pysindy.STLSQ(threshold=0.1))
    theirs.fit(true, t=t, x_dot=rate(true))
    equations = {"x1": "1.1*x1 - 0.4*x1*x2", "x2": "0.4*x1*x2 - x2"}
    states = "".join(f'[[state]]\nname = "{name}"\nequation = "{right}"\n' for name, right in equations.items())
    ours = gpsindy.Model.from_toml(f'schema = "gpsindy.model/1"\nname = "lotka-volterra"\n{states}')
    dense = t[0] + (t[-1] - t[0]) * np.arange(240) / 239
    reference = solve_ivp(lambda _, x: rate(x[None])[0], (0, t[-1]), true[0], t_eval=dense, rtol=1e-12, atol=1e-12).y.T

    def their_rollout(tolerance):
        return theirs.simulate(true[0], dense, integrator_kws={"method": "LSODA", "rtol": tolerance, "atol": tolerance})

    def our_rollout(tolerance):
        return ours.simulate(true[0], dense, tolerance=tolerance).x

    def off(found):
        return float(np.max(np.abs(found - reference)))

    print(f"{'rollout of 240 samples':30}{'pysindy ms':>12}{'ours ms':>10}{'ratio':>10}{'their error':>14}{'our error':>12}")
    for tolerance in (1e-6, 1e-8):
        turns = []
        for _ in range(repeats):
            found, _, busy = timed(their_rollout, tolerance)
            again, _, ours_busy = timed(lambda tolerance: [our_rollout(tolerance) for _ in range(100)][-1], tolerance)
            turns.append((busy, ours_busy / 100, off(found), off(again)))
        them, us, missed, ours_missed = (median(turn[k] for turn in turns) for k in range(4))
        label = f"tolerance {tolerance:.0e}"
        print(f"{label:30}{1e3 * them:12.2f}{1e3 * us:10.4f}{them / us:10.0f}{missed:14.1e}{ours_missed:12.1e}", flush=True)


def main(repeats, parts):
    warnings.simplefilter("ignore")  # Optimisers that stop at a bound or at their last iteration.
    t = STEP * np.arange(N_SAMPLES)
    true = solve_ivp(lambda _, x: rate(x[None])[0], (0, t[-1]), [10, 5], t_eval=t, rtol=1e-10, atol=1e-10).y.T
    y = true + NOISE * np.random.default_rng(SEED).standard_normal(true.shape)

    def missed_states(x):
        return rms(x, true)

    def missed_rates(found):
        if isinstance(found, list):
            return rms(np.column_stack([fit.predict(library(true)) for fit in found]), rate(true))
        return rms(found.predict(true), rate(true))

    jobs = [
        ("smoothing", their_smoothing, our_smoothing, missed_states),
        ("identification", their_identification, our_identification, missed_rates),
    ]
    blas = sorted({str(pool.get("architecture")) for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"})
    versions = f"gpsindy {gpsindy.__version__}, scikit-learn {sklearn.__version__}, numpy {np.__version__}"
    print(f"{versions}, scipy {scipy.__version__}, BLAS {'/'.join(blas)}, medians of {repeats}")
    if "engines" in parts:
        engines(repeats)
    if "rollouts" in parts:
        rollouts(repeats, t, true)
    if "pipeline" not in parts:
        return
    heads = ("scikit-learn s", "ours s", "ratio", "of processor", "their error", "our error")
    print(f"{'':26}" + "".join(f"{head:>16}" for head in heads))
    for (name, theirs, ours, missed), n_starts in product(jobs, (1, 2)):
        ours(t, y)
        turns = [(timed(theirs, t, y, n_starts), timed(ours, t, y)) for _ in range(repeats)]
        elapsed, busy = ([median(turn[side][k] for turn in turns) for side in (0, 1)] for k in (1, 2))
        errors = "".join(f"{missed(result):16.4f}" for result, *_ in turns[0])
        label = f"{name}, {n_starts} start{'s' * (n_starts - 1)}"
        ratios = f"{elapsed[0] / elapsed[1]:16.1f}{busy[0] / busy[1]:16.1f}"
        print(f"{label:26}{elapsed[0]:16.3f}{elapsed[1]:16.4f}{ratios}{errors}", flush=True)


if __name__ == "__main__":
    counts = [int(a) for a in sys.argv[1:] if a.isdigit()]
    named = [a for a in sys.argv[1:] if not a.isdigit()]
    main(counts[0] if counts else 5, named or ["pipeline", "engines", "rollouts"])
