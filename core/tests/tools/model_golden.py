"""Writes core/tests/data/model_golden.txt: metrics, objectives and violations of made-up scenarios and plans.

    python3 core/tests/tools/model_golden.py MODEL_PY > core/tests/data/model_golden.txt

MODEL_PY is an independent NumPy/SciPy reading of the model with `metrics`, `evaluate` and `violations`; it shares no
code with this crate. Its double-precision inverses keep 4 to 15 digits where variances differ much, so the
location errors are taken from its formulas (12), (14) in 60-digit arithmetic here, from positions and the variances
that it gives. Scenarios are drawn from a fixed seed, and hold everything the model has. One item a line, words
separated by blanks; `none` and `inf` as they read.
"""
import importlib.util
import math
import sys

import numpy as np
from mpmath import mp, mpf

METRICS = ["detection", "false_alarm", "cep2", "cep", "aee", "gdop", "log_cep2", "log_cep", "log_aee", "log_gdop"]
INTERVALS = 8
DOMAIN = 10.0
SOFTENING = 0.05

mp.dps = 60

rng = np.random.default_rng(20240611)


def text(value):
    if value is None:
        return "none"
    if isinstance(value, (list, tuple, np.ndarray)):
        return " ".join(text(entry) for entry in value)
    return repr(float(value)) if isinstance(value, (float, np.floating)) else str(value)


def say(*words):
    print(" ".join(text(word) for word in words))


def place(dim):
    point = rng.uniform(0.0, DOMAIN, dim)
    if dim == 3:
        point[2] = rng.uniform(0.0, 0.5)
    return [float(component) for component in point]


def toa(path_loss):
    return {"model": "toa", "c1": 0.01, "c2": 0.1, "path_loss": path_loss}


def rss(path_loss):
    return {"model": "rss", "scale": 0.02, "path_loss": path_loss}


def proxy(path_loss, scale=0.3, epsilon=0.3):
    return {"model": "proxy", "scale": scale, "epsilon": epsilon, "path_loss": path_loss}


def energy(samples, path_loss, log_threshold=3.0):
    return {"model": "energy", "samples": samples, "signal": 0.7, "noise": 1.1, "log_threshold": log_threshold,
            "path_loss": path_loss}


def sensors(dim, parts, moving=()):
    """parts: one (ranging, detection) a sensor."""
    listed = []
    for index, (ranging, detection) in enumerate(parts):
        sensor = {"jam": {"error_gain": 20.0 * (index % 4) / 3, "error_exponent": [1.0, 2.0, 1.4][index % 3],
                          "detect_gain": 1.0, "detect_exponent": [1.0, 1.7][index % 2]}}
        if index in moving:
            sensor["track"] = [{"t": t, "position": place(dim)} for t in (5.3, 33.1, 63.7, 200.0)]
        else:
            sensor["position"] = place(dim)
        if ranging:
            sensor["ranging"] = ranging
        if detection:
            sensor["detection"] = detection
        listed.append(sensor)
    return listed


def agent(dim, **more):
    return {"name": f"uav{rng.integers(1 << 30)}", "start": place(dim), "goal": place(dim), "speed_max": 0.4,
            "accel_max": 0.05, **more}


def jammer(pattern, betrayal="none", **more):
    return {"jammer": {"pattern": pattern, "detection_model": betrayal, "budget": 20.0, **more}}


def term(metric, sense="min", reduce="integral", weight=1.0, **more):
    return {"metric": metric, "sense": sense, "reduce": reduce, "weight": weight, **more}


def scenario(name, dim, agents, sensors, terms, **more):
    return {"name": name, "dimension": dim, "softening": SOFTENING, "reference_point": "current",
            "time": {"max": 90.0, "target": 60.0, "penalty": 0.7},
            "domain": {"min": [0.0] * dim, "max": [DOMAIN] * dim}, "agent": agents, "sensor": sensors,
            "objective": {"term": terms}, **more}


def scenarios():
    flat = [(toa(2.0), proxy(2.0))] * 8
    yield scenario("plain", 2, [agent(2)], sensors(2, flat), [term("detection"), term("log_aee", "max", weight=0.3)])
    odd = [(rss(g), proxy(d, epsilon=0.7)) for g, d in [(2.7, 3.0), (1.0, 1.0), (4.0, 4.0), (2.0, 0.5), (0.8, 2.3)]]
    yield scenario("lagged", 2, [agent(2, start_velocity=[0.05, -0.02])], sensors(2, odd),
                   [term("log_cep", "max"), term("gdop", weight=1e-4), term("log_cep2", "max", weight=0.2)],
                   reference_point="lagged")
    tests = [(toa(1.0), energy(1, 0.5)), (rss(1.5), energy(2, 1.0, 1.0)), (toa(4.0), energy(7, 1.3, 0.4)),
             (rss(3.0), energy(40, 1.0)), (toa(0.5), energy(101, 2.0)), (toa(3.0), energy(1000, 1.0, 6.0)),
             (rss(2.0), energy(4097, 1.0, 0.5)), (None, energy(100, 1.0, 0.0))]
    yield scenario("energy", 2, [agent(2)], sensors(2, tests, {1}),
                   [term("detection"), term("false_alarm", weight=2.0), term("detection", reduce="extreme")])
    weak = [(toa(2.0), proxy(2.0, 0.05, 0.3))] * 6
    team = [agent(2, weight=1.3, **jammer("isotropic", "linear")), agent(2, **jammer("isotropic", "max", q=3.5)),
            agent(2, weight=0.6)]
    yield scenario("jam", 2, team, sensors(2, weak, {2}),
                   [term("log_aee", "max"), term("detection", weight=20.0), term("cep", "max", weight=0.1)],
                   limit=[{"metric": "detection", "max": 0.2}, {"metric": "cep", "min": 0.01}])
    beams = [agent(2, **jammer("cosine", "sigmoid")), agent(2, **jammer("cone", "max", beam_width=1.5)),
             agent(2, **jammer("cone", "none", beam_width=5.0))]
    yield scenario("beam", 2, beams, sensors(2, weak),
                   [term("log_gdop", "max"), term("detection", weight=3.0), term("aee", "max", weight=0.01),
                    term("aee", "max", "extreme", agents=[beams[0]["name"], beams[2]["name"]])])
    silent = [agent(2, dropout={"budget": 18.7}), agent(2, weight=0.4, dropout={"budget": 0.0})]
    yield scenario("dropout", 2, silent, sensors(2, [(toa(2.0), proxy(2.0)), (rss(2.0), proxy(1.5)), (toa(1.0), None),
                                                     (None, proxy(4.0)), (rss(0.7), proxy(2.0))]),
                   [term("detection"), term("cep2", "max", weight=1e-3), term("log_gdop")])
    high = [(toa(1.5), proxy(2.0)), (rss(2.2), energy(100, 1.0)), (toa(2.0), proxy(1.0)), (toa(2.0), None),
            (rss(2.0), proxy(3.0)), (toa(2.5), energy(33, 0.7)), (rss(3.5), proxy(2.0))]
    crew = [agent(3, dropout={"budget": 5.0}, **jammer("cone", "sigmoid", beam_width=2.5)),
            agent(3, weight=0.7, **jammer("isotropic", "linear"))]
    yield scenario("volume", 3, crew, sensors(3, high, {0, 4}),
                   [term("log_aee", "max"), term("detection", weight=5.0), term("gdop", weight=0.1),
                    term("cep", "min", "extreme")], reference_point="lagged",
                   region=[{"center": [5.0, 5.0], "radius": 2.0, "from": 5.0, "until": 80.0}])
    timed = [(toa(2.0), proxy(2.0)), (toa(2.0), proxy(2.0)), (toa(2.0), proxy(2.0)), (rss(2.0), proxy(2.0))]
    yield scenario("timed", 2, [agent(2, start_velocity=[0.1, 0.1])], sensors(2, timed, {0, 1, 3}),
                   [term("detection", until=40.0), term("log_cep", "max", **{"from": 20.0}),
                    term("log_aee", "max", "extreme", **{"from": 10.0, "until": 55.0}),
                    term("false_alarm", "max"), term("detection", "max", "extreme", weight=0.5)],
                   reference_point="lagged",
                   region=[{"center": [3.0, 4.0], "radius": 1.5}, {"center": [7.0, 6.0], "radius": 2.0, "from": 20.0,
                                                                  "until": 45.0}],
                   limit=[{"metric": "log_aee", "min": -2.0, "max": 3.0}])
    few = [(toa(2.0), proxy(2.0)), (rss(2.0), energy(64, 1.0)), (toa(2.0), proxy(1.0)), (None, proxy(2.0))]
    yield scenario("few", 3, [agent(3), agent(3)], sensors(3, few, {3}), [term("detection", reduce="extreme")])
    lattice = [(toa(2.0), proxy(2.0)), (toa(1.0), None), (rss(2.0), None), (toa(2.0), proxy(2.0)), (rss(1.5), None)]
    yield scenario("volume-plain", 3, [agent(3)], sensors(3, lattice), [term("cep2"), term("aee", "max")])


def position(sc, agent, model, node, time):
    """Near a sensor, far away, or anywhere, in turn."""
    dim = len(agent["start"])
    if node % 4 == 1:
        sensor = sc["sensor"][rng.integers(len(sc["sensor"]))]
        direction = rng.normal(size=dim)
        radius = SOFTENING * rng.uniform(0.1, 2.0)
        near = model.sensor_position(sensor, time) + radius * direction / np.linalg.norm(direction)
        return [float(component) for component in near]
    if node % 4 == 3:
        return [float(component) for component in rng.normal(size=dim) * 2.0 * DOMAIN]
    return place(dim)


def plan(sc, model, stepped):
    count = INTERVALS + 1
    if stepped:
        times = np.concatenate([[2.0], 2.0 + np.cumsum(rng.uniform(4.0, 16.0, INTERVALS))])
    else:
        times = 60.0 / INTERVALS * np.arange(count)
    agents = []
    for listed in sc["agent"]:
        jams, drops = "jammer" in listed, "dropout" in listed
        level = rng.uniform(0.0, 0.8, count) * (rng.uniform(size=count) < 0.8)
        drop = rng.uniform(0.0, 0.95, count)
        drop[4] = 0.99995
        agents.append({
            "name": listed["name"],
            "path": [position(sc, listed, model, node, times[node]) for node in range(count)],
            "jam": [float(z) for z in level] if jams else [0.0] * count,
            "azimuth": [float(a) for a in rng.uniform(-math.pi, math.pi, count)] if jams else [0.0] * count,
            "dropout": [float(d) for d in drop] if drops else [0.0] * count,
        })
    made = {"start_time": float(times[0]), "duration": float(times[-1] - times[0]), "agents": agents}
    made["times"] = [float(time) for time in times]
    return made


def say_scenario(sc):
    frame = sc["time"]
    say("scenario", sc["name"], sc["dimension"], sc["softening"], sc["reference_point"], INTERVALS, frame["max"],
        frame["target"], frame["penalty"], sc["domain"]["min"], sc["domain"]["max"])
    for listed in sc["agent"]:
        say("agent", listed["start"], listed["goal"], listed["speed_max"], listed["accel_max"],
            listed.get("weight", 1.0), listed.get("start_velocity"))
        if "jammer" in listed:
            jam = listed["jammer"]
            say("jammer", jam["pattern"], jam.get("beam_width"), jam["detection_model"], jam.get("q"), jam["budget"])
        if "dropout" in listed:
            say("dropout", listed["dropout"]["budget"])
    for sensor in sc["sensor"]:
        say("sensor", *[sensor["jam"][key] for key in ("error_gain", "error_exponent", "detect_gain",
                                                       "detect_exponent")])
        if "position" in sensor:
            say("position", sensor["position"])
        for knot in sensor.get("track", []):
            say("knot", knot["t"], knot["position"])
        for part in ("ranging", "detection"):
            if part in sensor:
                say(*sensor[part].values())
    names = [listed["name"] for listed in sc["agent"]]
    for listed in sc["objective"]["term"]:
        mask = sum(1 << names.index(name) for name in listed.get("agents", names))
        say("term", listed["metric"], listed["sense"], listed["reduce"], listed["weight"], mask,
            listed.get("from", -math.inf), listed.get("until", math.inf))
    for region in sc.get("region", []):
        say("region", region["center"], region["radius"], region.get("from", -math.inf),
            region.get("until", math.inf))
    for limit in sc.get("limit", []):
        say("limit", limit["metric"], limit.get("min"), limit.get("max"))


def say_plan(sc, made, model):
    result = model.evaluate(sc, made)
    say("plan", made["times"])
    for index, track in enumerate(made["agents"]):
        for node, values in enumerate(result["series"][index]):
            say("node", index, track["path"][node], track["jam"][node], track["azimuth"][node],
                track["dropout"][node], *[values.get(metric) for metric in METRICS])
    say("objective", result["objective"])
    for name, value in result["violation"].items():
        say("violation", name, value)


def refine(model):
    """Has the reading's location errors computed in 60 digits."""
    plain = model.metrics

    def metrics(sc, t, k, xs, zs, alphas, thetas, ref=None):
        out = plain(sc, t, k, xs, zs, alphas, thetas, ref)
        if "cep2" not in out:
            return out
        eps, x = sc["softening"], np.asarray(xs[k], float)
        r0 = [mpf(float(c)) for c in (x if ref is None else ref)]
        rows, variances = [], []
        for s in sc["sensor"]:
            if "ranging" not in s:
                continue
            y = model.sensor_position(s, t)
            v = mpf(model.ranging_variance(s, model.soft_distance(x, y, eps)))
            v *= mpf(model.jam_error_factor(sc, s, y, xs, zs, alphas, eps))
            variances.append(v / mpf(max(1 - thetas[k], model.THETA_FLOOR)) ** 2)
            offset = [a - mpf(float(b)) for a, b in zip(r0, y)]
            length = mp.sqrt(sum(c * c for c in offset) + mpf(eps) ** 2)
            rows.append([c / length for c in offset])
        F, n = mp.matrix(rows), len(rows)
        H = mp.matrix(n - 1, n)
        for i in range(n - 1):
            H[i, i], H[i, i + 1] = 1, -1
        J = F.T * H.T * (H * mp.diag(variances) * H.T) ** -1 * H * F + mpf(model.INFO_FLOOR) * mp.eye(len(r0))
        P = J ** -1
        trace, det = sum(P[i, i] for i in range(len(r0))), mp.det(P)
        exact = {"cep2": trace, "cep": mp.sqrt(trace), "aee": model.AEE_SCALE * mp.sqrt(det),
                 "gdop": mp.sqrt(trace) / sum(variances)}
        for name, value in exact.items():
            out[name], out["log_" + name] = float(value), float(mp.log(value))
        return out

    model.metrics = metrics


def main():
    spec = importlib.util.spec_from_file_location("model", sys.argv[1])
    model = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(model)
    refine(model)
    print("# Written by core/tests/tools/model_golden.py from an independent NumPy/SciPy reading of the model.")
    for sc in scenarios():
        say_scenario(sc)
        for stepped in (False, True):
            say_plan(sc, plan(sc, model, stepped), model)


main()
