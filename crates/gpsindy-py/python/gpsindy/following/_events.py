"""The functions of ``randomization.py``: they make the events of mjlab and of Isaac Lab from the tables above them."""

from __future__ import annotations

EVENTS = '''
_MJLAB_JOINTS = {"frictionloss": "joint_friction", "damping": "joint_damping", "armature": "joint_armature", "stiffness": "joint_stiffness"}


def ranges():
    """All ranges by name: those that the logs identify, those that they bound, and the prior ones."""
    return {**PRIOR, **BOUNDED, **IDENTIFIED}


def _by_element(attributes):
    """Ranges of these attributes: ``{element: {attribute: range}}``. A driver's kd counts as a servo's kv."""
    found = {}
    for name, span in ranges().items():
        element, _, attribute = name.rpartition(".")
        attribute = "kv" if attribute == "kd" else attribute
        if attribute in attributes:
            found.setdefault(element, {})[attribute] = span
    return found


def mjlab_events(entity="robot"):
    """Events of mjlab: a dictionary for the ``events`` of an environment. Delays are the actuators': see mjlab_delays."""
    import math
    import re

    from mjlab.envs.mdp import dr
    from mjlab.managers.event_manager import EventTermCfg
    from mjlab.managers.scene_entity_config import SceneEntityCfg

    events = {}
    for joint, found in _by_element(_MJLAB_JOINTS).items():
        for attribute, span in found.items():
            params = {"ranges": span, "operation": "abs", "asset_cfg": SceneEntityCfg(entity, joint_names=(re.escape(joint),))}
            events[f"{joint}.{attribute}"] = EventTermCfg(mode="startup", func=getattr(dr, _MJLAB_JOINTS[attribute]), params=params)
    for body, found in _by_element(("mass",)).items():
        # Mass and inertia in proportion: pseudo_inertia scales both by exp(2 alpha).
        alpha = tuple(0.5 * math.log(max(value, 1e-9) / NOMINAL[f"{body}.mass"]) for value in found["mass"])
        params = {"alpha_range": alpha, "asset_cfg": SceneEntityCfg(entity, body_names=(re.escape(body),))}
        events[f"{body}.mass"] = EventTermCfg(mode="startup", func=dr.pseudo_inertia, params=params)
    for actuator, found in _by_element(("kp", "kv")).items():
        # mjlab counts groups of actuators here, so each of these actuators needs a group of its own.
        nominal = {"kp": NOMINAL.get(f"{actuator}.kp"), "kv": NOMINAL.get(f"{actuator}.kv", NOMINAL.get(f"{actuator}.kd"))}
        scaled = {key: tuple(value / nominal[key] for value in span) for key, span in found.items() if nominal[key]}
        params = {
            "kp_range": scaled.get("kp", (1.0, 1.0)),
            "kd_range": scaled.get("kv", (1.0, 1.0)),
            "operation": "scale",
            "asset_cfg": SceneEntityCfg(entity, actuator_names=[re.escape(actuator)]),
        }
        events[f"{actuator}.gains"] = EventTermCfg(mode="startup", func=dr.pd_gains, params=params)
    for joint, span in FORCES.items():
        params = {"span": span, "asset_cfg": SceneEntityCfg(entity, joint_names=(re.escape(joint),))}
        events[f"{joint}.force"] = EventTermCfg(mode="interval", interval_range_s=FORCE_HELD, func=_mjlab_force, params=params)
    return events


def _mjlab_force(env, env_ids, span, asset_cfg):
    """Draws a generalised force on joints anew; it stays until the next draw."""
    import torch

    asset = env.scene[asset_cfg.name]
    places = asset.indexing.joint_v_adr[asset_cfg.joint_ids].long()
    envs = torch.arange(env.num_envs, device=env.device) if env_ids is None else env_ids
    drawn = torch.empty((len(envs), len(places)), device=env.device).uniform_(*span)
    env.sim.data.qfrc_applied[envs[:, None], places] = drawn


def mjlab_delays(actuators):
    """Sets the delays of commands, in physics steps, in a list of mjlab's ``ActuatorCfg``, and returns it."""
    for actuator in actuators:
        steps = _steps_of(actuator.target_names_expr)
        if steps is not None:
            actuator.delay_min_lag, actuator.delay_max_lag = steps
    return actuators


def isaaclab_events(entity="robot"):
    """Events of Isaac Lab: a dictionary of ``EventTermCfg``. Delays are the actuators': see isaaclab_delays.

    Friction and damping of joints need Isaac Sim 5. A passive spring (``stiffness``) has no field there.
    """
    import re

    import isaaclab.envs.mdp as mdp
    from isaaclab.managers import EventTermCfg, SceneEntityCfg

    def joint_of(name):
        return SceneEntityCfg(entity, joint_names=[re.escape(name)])

    events = {}
    for joint, found in _by_element(("frictionloss", "damping")).items():
        # Isaac Lab's own event gives the viscous coefficient the numbers of the dry one.
        params = {"asset_cfg": joint_of(joint), "dry": found.get("frictionloss"), "viscous": found.get("damping")}
        events[f"{joint}.friction"] = EventTermCfg(func=_isaaclab_friction, mode="startup", params=params)
    for joint, found in _by_element(("armature",)).items():
        params = {"asset_cfg": joint_of(joint), "armature_distribution_params": found["armature"], "operation": "abs"}
        events[f"{joint}.armature"] = EventTermCfg(func=mdp.randomize_joint_parameters, mode="startup", params=params)
    arguments = {"kp": "stiffness_distribution_params", "kv": "damping_distribution_params"}
    for actuator, found in _by_element(arguments).items():
        if actuator in DRIVES:
            # A servo's length is its gear times the joint's position, and its torque its gear times its force. A driver reads the
            # joint itself.
            gear = GEARS[actuator] ** (1 if f"{actuator}.kd" in NOMINAL else 2)
            gains = {arguments[key]: tuple(gear * value for value in span) for key, span in found.items()}
            params = {"asset_cfg": joint_of(DRIVES[actuator]), **gains, "operation": "abs"}
            events[f"{actuator}.gains"] = EventTermCfg(func=mdp.randomize_actuator_gains, mode="startup", params=params)
    for body, found in _by_element(("mass",)).items():
        place = SceneEntityCfg(entity, body_names=[re.escape(body)])
        params = {"asset_cfg": place, "mass_distribution_params": found["mass"], "operation": "abs"}
        events[f"{body}.mass"] = EventTermCfg(func=mdp.randomize_rigid_body_mass, mode="startup", params=params)
    for joint, span in FORCES.items():
        params = {"asset_cfg": joint_of(joint), "span": span}
        events[f"{joint}.force"] = EventTermCfg(func=_isaaclab_force, mode="interval", interval_range_s=FORCE_HELD, params=params)
    return events


def _isaaclab_draw(env, env_ids, asset_cfg, span):
    import torch

    asset = env.scene[asset_cfg.name]
    envs = torch.arange(env.scene.num_envs, device=asset.device) if env_ids is None else env_ids
    joints = asset.num_joints if isinstance(asset_cfg.joint_ids, slice) else len(asset_cfg.joint_ids)
    return asset, envs, torch.empty((len(envs), joints), device=asset.device).uniform_(*span)


def _isaaclab_friction(env, env_ids, asset_cfg, dry, viscous):
    """Draws dry friction, in effort, and viscous friction of joints."""
    at = {"joint_ids": asset_cfg.joint_ids}
    if dry is not None:
        asset, envs, drawn = _isaaclab_draw(env, env_ids, asset_cfg, dry)
        asset.write_joint_friction_coefficient_to_sim(joint_friction_coeff=drawn, joint_dynamic_friction_coeff=drawn, env_ids=envs, **at)
    if viscous is not None:
        asset, envs, drawn = _isaaclab_draw(env, env_ids, asset_cfg, viscous)
        asset.write_joint_viscous_friction_coefficient_to_sim(drawn, env_ids=envs, **at)


def _isaaclab_force(env, env_ids, asset_cfg, span):
    """Draws a feed-forward effort on joints anew; it stays until the next draw."""
    asset, envs, drawn = _isaaclab_draw(env, env_ids, asset_cfg, span)
    asset.set_joint_effort_target(drawn, joint_ids=asset_cfg.joint_ids, env_ids=envs)


def isaaclab_delays(actuators):
    """Sets the delays of commands, in physics steps, in a dictionary of ``DelayedPDActuatorCfg``, and returns it."""
    for name, actuator in actuators.items():
        steps = _steps_of(actuator.joint_names_expr)
        if steps is not None:
            if not hasattr(actuator, "max_delay"):
                raise ValueError(f"actuators: {name} has no delay; make it a DelayedPDActuatorCfg")
            actuator.min_delay, actuator.max_delay = steps
    return actuators


def _steps_of(expressions):
    """Fewest and most steps of the delay of the joints that these expressions match; None where none has a delay."""
    import re

    joints = [joint for joint in DRIVES.values() if any(re.fullmatch(one, joint) for one in expressions)]
    late = {DRIVES[actuator]: steps for actuator, steps in DELAY_STEPS.items() if actuator in DRIVES}
    spans = {late.get(joint) for joint in joints}
    if len(spans) > 1:
        raise ValueError(f"actuators of {', '.join(joints)} are one group and have different delays; give each a group of its own")
    return spans.pop() if spans else None
'''
