"""What each step of the default buys, on the paper's simulated systems without given derivatives."""

from __future__ import annotations

from argparse import Namespace

import coefficients

STEPS = ["differences", "smoothed-states", "gp-time", "weak", "weak-lasso", "default"]


def run(options: Namespace) -> str:
    """The table of the coefficients' experiment with steps as rows."""
    steps = Namespace(**vars(options))
    steps.methods = options.methods or STEPS
    steps.regimes = options.regimes or ["free10", "free5"]
    return coefficients.run(steps, "ablation")
