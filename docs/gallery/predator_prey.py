import gpsindy

logs = gpsindy.read_log("data/lotka_volterra.csv", columns=["x1", "x2"])
found = gpsindy.GPSINDy(degree=2).fit(logs)
print(found.equations())

truth = {("x1", "x1"): 1.1, ("x1", "x1*x2"): -0.4, ("x2", "x2"): -1.0, ("x2", "x1*x2"): 0.4}
terms = list(found.get_feature_names_out())
for row, state in enumerate(["x1", "x2"]):
    for column, term in enumerate(terms):
        value, error = found.coef_[row, column], found.standard_errors_[row, column]
        if (state, term) not in truth:
            assert value == 0.0, (state, term, value)
        else:
            assert abs(value - truth[state, term]) < max(3 * error, 0.01), (state, term, value, error)
            print(f"{state}': {term}  {value:.4f} +- {error:.4f}")

import matplotlib

matplotlib.use("agg")
found.model_.plot(logs).savefig("predator_prey.png")
