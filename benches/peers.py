"""Time of the paper's pipeline: the Python package against the same steps composed of scikit-learn, one thread each.

Lotka-Volterra as in the paper, section V-A: 240 samples of 2 states, one every 0.1 s, noise 0.05.

- smoothing: a Gaussian process over time a state, of five kernels that of the lowest negative log likelihood;
- identification: smoothing, a second Gaussian process from smoothed states to derivatives (four kernels), and LASSO by
  cross-validation over polynomials of degree 3, sines and cosines.

scikit-learn optimises each kernel from one start (its default) and from two; the package ranks a list of starts and
optimises from the best two, unless they are alike. scikit-learn does not offer the derivative of a process, so
differences of the smoothed states stand in. The two sides take turns; times are medians of elapsed seconds, and the
second ratio, of processor time, suffers less from a busy machine. Errors are root mean squares against the true states
or the true derivatives: a fast answer counts only when it is as good.

Needs scikit-learn, which the environment of `cargo xtask python` has; takes about two minutes:

    target/venv/bin/python benches/peers.py [REPEATS]
"""

import os
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
from time import perf_counter, process_time  # noqa: E402

import numpy as np  # noqa: E402
import scipy  # noqa: E402
import sklearn  # noqa: E402
import threadpoolctl  # noqa: E402
from scipy.integrate import solve_ivp  # noqa: E402
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


def main(repeats):
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
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
