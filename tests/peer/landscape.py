"""The peer of landscapes: every metric over a grid, vectorised over all points, in NumPy and SciPy.

One request a line on standard input, one answer a line on standard output, both JSON:

    {"scenario": "swarm4.toml", "columns": 200, "rows": 200, "metric": "log_aee"}
    {"seconds": 0.05, "values": [..]}

`seconds` is the time of the metrics alone. Arrays are (sensors, points), so that sums over sensors run over rows.
Limits: sensors at their places at time 0; a single agent without controls; the height is that of the first start.
"""

import json
import math
import sys
import time
import tomllib

import numpy as np
import scipy
from scipy.special import gammaincc

AEE_SCALE = 23.964 * math.pi


def places(scenario):
    return np.array([s["position"] if "position" in s else s["track"][0]["position"] for s in scenario["sensor"]])


def probabilities(sensor, distance):
    detection = sensor.get("detection")
    if detection is None:
        return 0.0, 0.0
    if detection["model"] == "proxy":
        return np.minimum(1, detection["scale"] / (detection["epsilon"] + distance ** detection["path_loss"])), 0.0
    signal, noise = detection["signal"] * distance ** (-2 * detection["path_loss"]), detection["noise"]
    logarithm = detection["log_threshold"] + 0.5 * detection["samples"] * np.log1p(signal / noise)
    threshold = 2 * noise * (signal + noise) / signal * logarithm
    half = 0.5 * detection["samples"]
    return gammaincc(half, 0.5 * threshold / (signal + noise)), gammaincc(half, 0.5 * threshold / noise)


def variance(ranging, distance):
    if ranging["model"] == "rss":
        return ranging["scale"] * distance ** (2 - 2 * ranging["path_loss"])
    loss = distance ** ranging["path_loss"]
    return ranging["c1"] * loss * (1 + ranging["c2"] * loss)


def metrics(scenario, points):
    offsets = points[None, :, :] - places(scenario)[:, None, :]
    distances = np.sqrt(np.einsum("jpi,jpi->jp", offsets, offsets) + scenario.get("softening", 1e-3) ** 2)
    missed, quiet = 1.0, 1.0
    for sensor, distance in zip(scenario["sensor"], distances):
        seen, false = probabilities(sensor, distance)
        missed, quiet = missed * (1 - seen), quiet * (1 - false)
    out = {"detection": 1 - missed, "false_alarm": 1 - quiet}
    ranging = [j for j, sensor in enumerate(scenario["sensor"]) if "ranging" in sensor]
    if len(ranging) <= points.shape[1]:
        return out
    variances = np.stack([variance(scenario["sensor"][j]["ranging"], distances[j]) for j in ranging])
    weights = 1 / variances
    directions = offsets[ranging] / distances[ranging][:, :, None]
    mean = np.einsum("jp,jpi->pi", weights, directions) / weights.sum(axis=0)[:, None]
    apart = directions - mean
    information = np.einsum("jpi,jpk->pik", weights[:, :, None] * apart, apart) + 1e-12 * np.eye(points.shape[1])
    covariance = np.linalg.inv(information)
    trace = np.trace(covariance, axis1=1, axis2=2)
    out["cep2"], out["cep"] = trace, np.sqrt(trace)
    out["aee"] = AEE_SCALE / np.sqrt(np.linalg.det(information))
    out["gdop"] = out["cep"] / variances.sum(axis=0)
    for name in ("cep2", "cep", "aee", "gdop"):
        out[f"log_{name}"] = np.log(out[name])
    return out


def grid(scenario, columns, rows):
    low, high = scenario["domain"]["min"], scenario["domain"]["max"]
    east = low[0] + (high[0] - low[0]) * (np.arange(columns) + 0.5) / columns
    north = low[1] + (high[1] - low[1]) * (np.arange(rows) + 0.5) / rows
    axes = [np.tile(east, rows), np.repeat(north, columns)]
    if scenario.get("dimension", 2) == 3:
        axes.append(np.full(columns * rows, float(scenario["agent"][0]["start"][2])))
    return np.stack(axes, axis=1)


def answer(request):
    if request.get("versions"):
        return {"versions": f"NumPy {np.__version__}, SciPy {scipy.__version__}", "variants": []}
    with open(request["scenario"], "rb") as file:
        scenario = tomllib.load(file)
    points = grid(scenario, request["columns"], request["rows"])
    begin = time.perf_counter()
    values = metrics(scenario, points)
    seconds = time.perf_counter() - begin
    return {"seconds": seconds, "values": values[request["metric"]].tolist()}


for line in sys.stdin:
    print(json.dumps(answer(json.loads(line))), flush=True)
