"""Copies of one FMU: many rows, each with parameters and a state of its own; fmpy instantiates them, the compiled part steps them."""

from __future__ import annotations

from typing import Any, Literal

from gpsindy._gpsindy import FmuCopies

Kind = Literal["model exchange", "co-simulation"]


def copies(description: Any, folder: str, kind: Kind, references: list[list[int]]) -> FmuCopies:
    """Instances of an unpacked FMU, as many as there are parameters; each is made when it is asked for.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription
    folder : str
        Where the FMU is unpacked.
    kind : Kind
    references : list of list of int
        Value references of states, controls, ports and parameters.
    """
    from fmpy.simulation import instantiate_fmu

    states, controls, ports, parameters = references
    clock = [v.valueReference for v in description.modelVariables if v.causality == "independent" and v.type in ("Real", "Float64")]
    named = {
        "states": states,
        "derivatives": [unknown.variable.valueReference for unknown in description.derivatives],
        "inputs": [*controls, *ports],
        "n_controls": len(controls),
        "parameters": parameters,
        "time": clock[0] if clock else None,
    }
    exchange = kind == "model exchange"

    def instantiate() -> Any:
        return instantiate_fmu(folder, description, "ModelExchange" if exchange else "CoSimulation", require_functions=False)

    indicators = int(description.numberOfEventIndicators or 0) if exchange else None
    return FmuCopies(instantiate, description.modelName, description.fmiVersion.startswith("2"), named, indicators)
