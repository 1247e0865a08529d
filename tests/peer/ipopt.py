"""The peer: CasADi with IPOPT on quietpath's scenario files, from the straight line.

One request a line on standard input, one answer a line on standard output, both JSON:

    {"scenario": "wight.toml", "variant": "sx", "solves": 1}
    {"seconds": [0.21], "build_seconds": 0.9, "iterations": 80, "status": "Solve_Succeeded", "objective": .., "plan": ..}

Without a request line, `python ipopt.py SCENARIO.toml` solves every variant once and prints a line each.

How the peer is treated:
- Derivatives are exact: CasADi differentiates the expressions, Hessian of the Lagrangian included.
- The problem is written in variables of order one: positions in domain widths, flight time in `time.max`; bounds on
  speed and acceleration are divided by themselves.
- Building the problem is not counted. `seconds` is what CasADi measures around IPOPT, without Python's own share.
- Variants: `sx` runs expanded scalar graphs, `mx` one compact graph a node; `-adaptive` asks for IPOPT's adaptive
  barrier. Whoever reports figures takes the fastest for each scenario.
- One thread (OMP_NUM_THREADS=1 is the caller's), linear solver MUMPS, which is what the packages come with.

The model is the scenario file's: right Riemann sums over N equal intervals, softened distances, the closed form
J = sum w_j (f_j - m)(f_j - m)' of the information matrix. Worst-case terms become a bound that is minimised.

Limits: keys that this script does not know make it answer with an error instead of another problem's solution.
"""

import json
import math
import os
import sys
import time
import tomllib

import casadi as ca

VARIANTS = {
    "sx": {"expand": True},
    "mx": {"expand": False},
    "sx-adaptive": {"expand": True, "ipopt.mu_strategy": "adaptive"},
}
TOLERANCE = 1e-7
ITERATIONS = 1500
SILENCE_FLOOR = 1e-3
INFORMATION_FLOOR = 1e-12
AEE_SCALE = 23.964 * math.pi

KNOWN = {
    "": "name dimension softening reference_point frame grid time domain agent sensor objective region limit rolling study",
    "agent": "name start goal start_velocity speed_max accel_max weight jammer dropout",
    "sensor": "name position track ranging detection jam",
    "region": "name center radius from until",
    "limit": "metric min max",
    "term": "metric sense reduce weight agents from until",
}


def refuse_unknown(scenario):
    tables = [("", scenario)]
    tables += [(kind, table) for kind in ("agent", "sensor", "region", "limit") for table in scenario.get(kind, [])]
    tables += [("term", term) for term in scenario["objective"]["term"]]
    for kind, table in tables:
        unknown = set(table) - set(KNOWN[kind].split())
        if unknown:
            raise ValueError(f"{kind or 'scenario'} has {', '.join(sorted(unknown))}, which the peer does not model")


# ---- the model at one node ------------------------------------------------------------------------------------


def power(base, exponent):
    """Whole powers without pow: cheaper, and their derivatives too."""
    if exponent == int(exponent) and abs(exponent) <= 8:
        result = 1.0
        for _ in range(int(abs(exponent))):
            result = result * base
        return result if exponent >= 0 else 1.0 / result
    return base**exponent


def chi_square_tail(degrees, value):
    """Q(degrees / 2, value / 2) as its finite sum."""
    half = 0.5 * value
    if degrees % 2 == 0:
        term, total = 1.0, 1.0
        for k in range(1, degrees // 2):
            term = term * half / k
            total = total + term
        return ca.exp(-half) * total
    tail = 1 - ca.erf(ca.sqrt(half))
    if degrees == 1:
        return tail
    term = ca.sqrt(half) / math.gamma(1.5)
    total = term
    for k in range(2, (degrees - 1) // 2 + 1):
        term = term * half / (k - 0.5)
        total = total + term
    return tail + ca.exp(-half) * total


def detector(detection, distance):
    """Probabilities of detection and of a false alarm."""
    if detection["model"] == "proxy":
        probability = detection["scale"] / (detection["epsilon"] + power(distance, detection["path_loss"]))
        return (probability if detection["scale"] <= detection["epsilon"] else ca.fmin(1, probability)), 0.0
    signal, noise = detection["signal"] * power(distance, -2 * detection["path_loss"]), detection["noise"]
    logarithm = detection["log_threshold"] + 0.5 * detection["samples"] * ca.log1p(signal / noise)
    threshold = 2 * noise * (signal + noise) / signal * logarithm
    samples = detection["samples"]
    return chi_square_tail(samples, threshold / (signal + noise)), chi_square_tail(samples, threshold / noise)


def betrayed(jammer, jam, probability, level, distance):
    """Probability of detection of an agent that jams."""
    model = jammer.get("detection_model", "none") if jammer else "none"
    if model == "none":
        return probability
    if model == "max":
        q = jammer.get("q", 15.0)
        return ca.fmin(1, (probability**q + (level + 1e-9) ** q) ** (1 / q))
    heard = jam.get("detect_gain", 0.0) * level / power(distance, jam.get("detect_exponent", 2.0))
    if model == "linear":
        return ca.fmin(1, probability * (1 + heard))
    return probability + (1 - probability) * (2 / (1 + ca.exp(-heard)) - 1)


def beam(jammer, azimuth, offset):
    pattern = jammer.get("pattern", "isotropic")
    if pattern == "isotropic":
        return 1.0
    length = ca.sqrt(offset[0] ** 2 + offset[1] ** 2 + 1e-12)
    cosine = (ca.cos(azimuth) * offset[0] + ca.sin(azimuth) * offset[1]) / length
    if pattern == "cosine":
        return ca.fmax(0, cosine) ** 2
    edge = math.cos(0.5 * jammer["beam_width"])
    return (ca.fmax(0, cosine - edge) / (1 - edge)) ** 2


def sensor_position(sensor, at):
    if "track" not in sensor:
        return ca.DM(sensor["position"])
    knots = sensor["track"]
    place = ca.SX(ca.DM(knots[0]["position"]))
    for a, b in zip(knots, knots[1:]):
        share = ca.fmin(1, ca.fmax(0, (at - a["t"]) / (b["t"] - a["t"])))
        place = place + share * (ca.DM(b["position"]) - ca.DM(a["position"]))
    return place


def node_function(scenario, agent, metrics):
    """(time, positions, levels, azimuths, silence, reference point) -> the metrics asked for, at one node."""
    agents, dim = scenario["agent"], scenario.get("dimension", 2)
    softening = scenario.get("softening", 1e-3) ** 2
    at, silence = ca.SX.sym("t"), ca.SX.sym("theta")
    positions = ca.SX.sym("x", dim, len(agents))
    levels, azimuths = ca.SX.sym("z", len(agents)), ca.SX.sym("alpha", len(agents))
    reference = ca.SX.sym("r", dim)
    jammer = agents[agent].get("jammer")
    missed, quiet, weights, directions, variances = 1.0, 1.0, [], [], 0.0
    locates = any(metric not in ("detection", "false_alarm") for metric in metrics)
    for sensor in scenario["sensor"]:
        place, jam = sensor_position(sensor, at), sensor.get("jam", {})
        distance = ca.sqrt(ca.sumsqr(positions[:, agent] - place) + softening)
        if "detection" in sensor:
            seen, false = detector(sensor["detection"], distance)
            seen = betrayed(jammer, jam, seen, levels[agent], distance)
            missed = missed * (1 - (1 - silence) * seen)
            quiet = quiet * (1 - false)
        if locates and "ranging" in sensor:
            ranging, factor = sensor["ranging"], 1.0
            for other, entry in enumerate(agents):
                if "jammer" in entry:
                    offset = place - positions[:, other]
                    reach = ca.sqrt(ca.sumsqr(offset) + softening)
                    gain = jam.get("error_gain", 0.0) * levels[other] * beam(entry["jammer"], azimuths[other], offset)
                    factor = factor + gain / power(reach, jam.get("error_exponent", 2.0))
            if ranging["model"] == "rss":
                variance = ranging["scale"] * power(distance, 2 - 2 * ranging["path_loss"])
            else:
                loss = power(distance, ranging["path_loss"])
                variance = ranging["c1"] * loss * (1 + ranging["c2"] * loss)
            variance = variance * factor
            if "dropout" in agents[agent]:
                variance = variance / ca.fmax(1 - silence, SILENCE_FLOOR) ** 2
            offset = reference - place
            directions.append(offset / ca.sqrt(ca.sumsqr(offset) + softening))
            weights.append(1 / variance)
            variances = variances + variance
    values = {"detection": 1 - missed, "false_alarm": 1 - quiet}
    if locates:
        values |= location_errors(dim, directions, weights, variances)
    inputs = [at, positions, levels, azimuths, silence, reference]
    return ca.Function("node", inputs, [ca.vertcat(*[values[metric] for metric in metrics])])


def location_errors(dim, directions, weights, variances):
    total = sum(weights)
    mean = sum(weight * direction for weight, direction in zip(weights, directions)) / total
    information = INFORMATION_FLOOR * ca.SX.eye(dim)
    for weight, direction in zip(weights, directions):
        apart = direction - mean
        information = information + weight * ca.mtimes(apart, apart.T)
    j = information
    if dim == 2:
        determinant = j[0, 0] * j[1, 1] - j[0, 1] * j[0, 1]
        minors = j[0, 0] + j[1, 1]
    else:
        a = j[1, 1] * j[2, 2] - j[1, 2] * j[1, 2]
        b = j[0, 2] * j[1, 2] - j[0, 1] * j[2, 2]
        c = j[0, 1] * j[1, 2] - j[0, 2] * j[1, 1]
        determinant = j[0, 0] * a + j[0, 1] * b + j[0, 2] * c
        minors = a + j[0, 0] * j[2, 2] - j[0, 2] * j[0, 2] + j[0, 0] * j[1, 1] - j[0, 1] * j[0, 1]
    trace, log_cep2 = minors / determinant, ca.log(minors / determinant)
    log_aee = math.log(AEE_SCALE) - 0.5 * ca.log(determinant)
    return {
        "cep2": trace,
        "cep": ca.sqrt(trace),
        "aee": ca.exp(log_aee),
        "gdop": ca.sqrt(trace) / variances,
        "log_cep2": log_cep2,
        "log_cep": 0.5 * log_cep2,
        "log_aee": log_aee,
        "log_gdop": 0.5 * log_cep2 - ca.log(variances),
    }


# ---- the whole problem ----------------------------------------------------------------------------------------


class Problem:
    """Variables, constraints and objective of a scenario; built once, solved in any variant."""

    def __init__(self, scenario):
        refuse_unknown(scenario)
        self.scenario, self.agents = scenario, scenario["agent"]
        self.dim, self.intervals = scenario.get("dimension", 2), scenario["grid"]["intervals"]
        self.width = max(b - a for a, b in zip(scenario["domain"]["min"], scenario["domain"]["max"]))
        self.allowed = scenario["time"]["max"] - scenario.get("start_time", 0.0)
        self.variables, self.lower, self.upper, self.guess = [], [], [], []
        self.rows, self.row_lower, self.row_upper = [], [], []
        self.lay_variables()
        self.bound_motion()
        self.keep_out()
        self.objective = self.weigh()
        self.solvers = {}

    def variable(self, name, rows, columns, lower, upper, guess):
        symbol = ca.MX.sym(name, rows, columns)
        self.variables.append(ca.vec(symbol))
        shape = ca.DM.ones(rows, columns)
        for values, target in ((lower, self.lower), (upper, self.upper), (guess, self.guess)):
            target.append(ca.vec(ca.DM(values) * shape if ca.DM(values).is_scalar() else ca.DM(values)))
        return symbol

    def constrain(self, rows, lower, upper):
        rows = ca.vec(rows)
        self.rows.append(rows)
        self.row_lower.append(lower * ca.DM.ones(rows.shape[0]))
        self.row_upper.append(upper * ca.DM.ones(rows.shape[0]))

    def first_duration(self):
        timing = self.scenario["time"]
        shortest = max(math.dist(agent["start"], agent["goal"]) / agent["speed_max"] for agent in self.agents)
        wanted = timing.get("target", 0.0) if timing.get("penalty", 0.0) > 0 else 0.0
        wanted = max(wanted if wanted > 0 else 1.3 * shortest, 1.05 * shortest)
        return wanted if wanted < self.allowed else 0.5 * (shortest + self.allowed)

    def lay_variables(self):
        n, count = self.intervals, len(self.agents)
        first = self.first_duration()
        self.share = self.variable("share", 1, 1, 1e-3, 1.0, first / self.allowed)
        self.duration = self.allowed * self.share
        self.h = self.duration / n
        self.path, self.level, self.azimuth, self.silence = [], [], [], []
        lower = ca.repmat(ca.DM(self.scenario["domain"]["min"]) / self.width, 1, n - 1)
        upper = ca.repmat(ca.DM(self.scenario["domain"]["max"]) / self.width, 1, n - 1)
        for index, agent in enumerate(self.agents):
            start, goal = ca.DM(agent["start"]), ca.DM(agent["goal"])
            line = ca.horzcat(*[start + (goal - start) * (i / n) for i in range(n + 1)])
            inner = self.variable(f"x{index}", self.dim, n - 1, lower, upper, line[:, 1:n] / self.width)
            self.path.append(ca.horzcat(start, self.width * inner, goal))
            zero = ca.MX.zeros(1, n + 1)
            self.level.append(zero), self.azimuth.append(zero), self.silence.append(zero)
            for key, kept in (("jammer", self.level), ("dropout", self.silence)):
                if key in agent:
                    budget = agent[key]["budget"]
                    first_level = min(0.5 * budget / first, 0.5)
                    inner = self.variable(f"{key}{index}", 1, n, 0.0, 1.0, first_level)
                    kept[index] = ca.horzcat(0, inner)
                    scale = max(budget, 1.0)
                    self.constrain(self.h * ca.sum2(inner) / scale, -ca.inf, budget / scale)
            if "jammer" in agent and agent["jammer"].get("pattern", "isotropic") != "isotropic":
                towards = [self.bearing(line[:, i], first * i / n) for i in range(1, n + 1)]
                guess = ca.DM(towards).T
                self.azimuth[index] = ca.horzcat(0, self.variable(f"a{index}", 1, n, -20.0, 20.0, guess))
        assert count == len(self.path)

    def bearing(self, position, at):
        """Direction to the nearest ranging sensor: the same first guess as quietpath's."""
        nearest, best = math.inf, 0.0
        for sensor in self.scenario["sensor"]:
            if "ranging" in sensor:
                offset = ca.evalf(ca.SX(sensor_position(sensor, ca.SX(at)))) - position
                square = float(ca.sumsqr(offset))
                if square < nearest:
                    nearest, best = square, math.atan2(float(offset[1]), float(offset[0]))
        return best

    def bound_motion(self):
        n = self.intervals
        h0 = self.allowed / n
        for agent, path in zip(self.agents, self.path):
            step = path[:, 1:] - path[:, :-1]
            bend = step[:, 1:] - step[:, :-1]
            speed, accel = agent["speed_max"] * h0, agent["accel_max"] * h0 * h0
            self.constrain(ca.sum1((step / speed) ** 2) - self.share**2, -ca.inf, 0.0)
            self.constrain(ca.sum1((bend / accel) ** 2) - self.share**4, -ca.inf, 0.0)
            if "start_velocity" in agent:
                change = step[:, 0] - self.h * ca.DM(agent["start_velocity"])
                self.constrain(ca.sumsqr(change / accel) - self.share**4, -ca.inf, 0.0)

    def keep_out(self):
        for region in self.scenario.get("region", []):
            if "from" in region or "until" in region:
                raise ValueError("region has a time window, which the peer does not model")
            center = ca.repmat(ca.DM(region["center"]), 1, self.intervals)
            for path in self.path:
                a, b = path[:2, :-1], path[:2, 1:]
                along = b - a
                share = ca.sum1((center - a) * along) / (ca.sum1(along**2) + 1e-12)
                near = a + ca.repmat(ca.fmin(1, ca.fmax(0, share)), 2, 1) * along - center
                self.constrain(ca.sum1((near / region["radius"]) ** 2), 1.0, ca.inf)

    def weigh(self):
        scenario, n = self.scenario, self.intervals
        start_time = scenario.get("start_time", 0.0)
        times = start_time + self.h * ca.DM(range(1, n + 1)).T
        terms, limits = scenario["objective"]["term"], scenario.get("limit", [])
        metrics = list(dict.fromkeys([part["metric"] for part in terms + limits]))
        everyone = ca.vertcat(*[path[:, 1:] for path in self.path])
        levels = ca.vertcat(*[level[:, 1:] for level in self.level])
        azimuths = ca.vertcat(*[azimuth[:, 1:] for azimuth in self.azimuth])
        lagged = scenario.get("reference_point", "current") == "lagged"
        total = 0.0
        for index, agent in enumerate(self.agents):
            node = node_function(scenario, index, metrics)
            one = self.reshaped(node).map(n)
            path = self.path[index]
            values = one(times, everyone, levels, azimuths, self.silence[index][:, 1:], path[:, :-1] if lagged else path[:, 1:])
            for limit in limits:
                row = values[metrics.index(limit["metric"]), :]
                scale = max(abs(limit.get("max", limit.get("min"))), 1e-9)
                self.constrain(row / scale, limit.get("min", -ca.inf) / scale, limit.get("max", ca.inf) / scale)
            for number, term in enumerate(terms):
                if "agents" not in term or agent["name"] in term["agents"]:
                    row = values[metrics.index(term["metric"]), :]
                    total = total + self.reduced(term, row, times, f"{index}_{number}") * agent.get("weight", 1.0)
        timing = scenario["time"]
        if timing.get("penalty", 0.0) > 0:
            late = ca.fmax(0, start_time + self.duration - timing.get("target", 0.0))
            total = total + timing["penalty"] * late**2
        return total

    def reshaped(self, node):
        """The node function with all agents' positions in one column, so that it maps over columns."""
        count = len(self.agents)
        at, positions, silence = ca.SX.sym("t"), ca.SX.sym("x", self.dim * count), ca.SX.sym("theta")
        levels, azimuths, reference = ca.SX.sym("z", count), ca.SX.sym("a", count), ca.SX.sym("r", self.dim)
        value = node(at, ca.reshape(positions, self.dim, count), levels, azimuths, silence, reference)
        return ca.Function("column", [at, positions, levels, azimuths, silence, reference], [value])

    def reduced(self, term, row, times, name):
        sign = -1.0 if term.get("sense", "min") == "max" else 1.0
        weight = term.get("weight", 1.0)
        window = 1.0
        if "from" in term or "until" in term:
            after, before = times >= term.get("from", -1e12), times < term.get("until", 1e12)
            window = ca.if_else(ca.logic_and(after, before), 1.0, 0.0)
        if term.get("reduce", "integral") == "integral":
            return sign * weight * self.h * ca.sum2(window * row)
        if "from" in term or "until" in term:
            raise ValueError("a worst-case term has a time window, which the peer does not model")
        worst = self.variable(f"worst{name}", 1, 1, -1e6, 1e6, 0.0)
        self.constrain(sign * row - worst, -ca.inf, 0.0)
        return weight * worst

    def solver(self, variant):
        if variant not in self.solvers:
            begin = time.perf_counter()
            problem = {"x": ca.vertcat(*self.variables), "f": self.objective, "g": ca.vertcat(*self.rows)}
            options = {
                "ipopt.print_level": 0,
                "ipopt.sb": "yes",
                "print_time": False,
                "record_time": True,
                "ipopt.tol": TOLERANCE,
                "ipopt.constr_viol_tol": TOLERANCE,
                "ipopt.max_iter": ITERATIONS,
                **VARIANTS[variant],
            }
            self.solvers[variant] = ca.nlpsol("peer", "ipopt", problem, options), time.perf_counter() - begin
        return self.solvers[variant]

    def solve(self, variant):
        solver, build = self.solver(variant)
        found = solver(
            x0=ca.vertcat(*self.guess),
            lbx=ca.vertcat(*self.lower),
            ubx=ca.vertcat(*self.upper),
            lbg=ca.vertcat(*self.row_lower),
            ubg=ca.vertcat(*self.row_upper),
        )
        stats = solver.stats()
        return {
            "seconds": stats["t_wall_total"],
            "build_seconds": build,
            "iterations": stats["iter_count"],
            "status": stats["return_status"],
            "objective": float(found["f"]),
            "plan": self.plan(found["x"]),
        }

    def plan(self, solution):
        parts = [self.duration, *self.path, *self.level, *self.azimuth, *self.silence]
        everything = ca.Function("parts", [ca.vertcat(*self.variables)], parts)(solution)
        duration, *rest = everything
        count = len(self.agents)
        agents = []
        for index, agent in enumerate(self.agents):
            path, level, azimuth, silence = (rest[index + count * part].full() for part in range(4))
            entry = {"name": agent["name"], "path": path.T.tolist()}
            if "jammer" in agent:
                entry["jam"] = level.ravel().clip(0, 1).tolist()
                entry["azimuth"] = azimuth.ravel().tolist()
            if "dropout" in agent:
                entry["dropout"] = silence.ravel().clip(0, 1).tolist()
            agents.append(entry)
        return {"scenario": self.scenario["name"], "duration": float(duration), "agents": agents}


class Peer:
    """Answers requests; keeps the last scenario's problem, so that it is built once."""

    def __init__(self):
        self.path, self.problem, self.build_seconds = None, None, 0.0

    def answer(self, path, variant, solves):
        if path != self.path:
            begin = time.perf_counter()
            with open(path, "rb") as file:
                self.problem = Problem(tomllib.load(file))
            self.path, self.build_seconds = path, time.perf_counter() - begin
        found = [self.problem.solve(variant) for _ in range(solves)]
        answer = found[-1]
        answer["seconds"] = [one["seconds"] for one in found]
        answer["build_seconds"] += self.build_seconds
        return answer


def main():
    peer = Peer()
    if len(sys.argv) > 1:
        for variant in VARIANTS:
            answer = peer.answer(sys.argv[1], variant, 1)
            del answer["plan"]
            print(variant, json.dumps(answer), flush=True)
        return
    # IPOPT writes to standard output what it cannot be kept from writing; answers go past it.
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        request = json.loads(line)
        if request.get("versions"):
            answer = {"versions": f"CasADi {ca.__version__}, IPOPT with MUMPS, tolerance {TOLERANCE:g}, Python {sys.version.split()[0]}", "variants": list(VARIANTS)}
        else:
            try:
                answer = peer.answer(request["scenario"], request["variant"], request.get("solves", 1))
            except (ValueError, KeyError, RuntimeError, ca.CasadiException if hasattr(ca, "CasadiException") else RuntimeError) as error:
                answer = {"error": f"{type(error).__name__}: {error}".splitlines()[0]}
        print(json.dumps(answer), file=out, flush=True)


if __name__ == "__main__":
    main()
