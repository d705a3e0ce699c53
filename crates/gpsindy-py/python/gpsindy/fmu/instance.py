"""One instance of an FMU, with parameters of its own: fmpy makes it, the compiled part steps it."""

from __future__ import annotations

from typing import Any, Literal

from gpsindy import _gpsindy
from gpsindy.data._tables import Array

Kind = Literal["model exchange", "co-simulation"]


def instance(description: Any, folder: str, kind: Kind, references: list[list[int]], parameters: Array) -> _gpsindy.FmuInstance:
    """An instance that makes single steps, each from a state of its own.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription
    folder : str
        Where the FMU is unpacked.
    kind : Kind
    references : list of list of int
        Value references of states, controls, ports and parameters.
    parameters : ndarray
        Values of the parameters.

    Raises
    ------
    ValueError
        A function of the FMU that failed, an event at a set time.
    """
    from fmpy.simulation import instantiate_fmu

    states, controls, ports, own = references
    clock = [v for v in description.modelVariables if v.causality == "independent" and v.type in ("Real", "Float64")]
    named = {
        "states": states,
        "derivatives": [unknown.variable.valueReference for unknown in description.derivatives],
        "inputs": [*controls, *ports],
        "parameters": own,
        "time": clock[0].valueReference if clock else None,
    }
    exchange = kind == "model exchange"
    fmu = instantiate_fmu(folder, description, "ModelExchange" if exchange else "CoSimulation", require_functions=False)
    indicators = int(description.numberOfEventIndicators or 0) if exchange else None
    two = description.fmiVersion.startswith("2")
    return _gpsindy.FmuInstance(fmu, description.modelName, two, named, parameters, indicators)
