"""NNSINDy's network, by scikit-learn."""

from __future__ import annotations

import warnings

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPRegressor

from library import Array


def refined(x: Array, dx: Array, seed: int) -> Array:
    """Derivatives as the paper's networks see them: 32 hidden ReLU neurons, Adam, 100 epochs of single samples."""
    found = np.empty_like(dx)
    for j in range(dx.shape[1]):
        net = MLPRegressor(hidden_layer_sizes=(32,), solver="adam", batch_size=1, max_iter=100, tol=0.0, random_state=seed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            found[:, j] = net.fit(x, dx[:, j]).predict(x)
    return found
