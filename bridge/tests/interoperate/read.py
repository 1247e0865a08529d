"""What pymavlink reads from our files: read.py WAYPOINTS TLOG. One JSON line."""

import json
import os
import sys

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil, mavwp  # noqa: E402

loader = mavwp.MAVWPLoader()
count = loader.load(sys.argv[1])
log = mavutil.mavlink_connection(sys.argv[2], dialect="ardupilotmega")
kinds, bad = {}, 0
while (message := log.recv_match()) is not None:
    kind = message.get_type()
    if kind == "BAD_DATA":
        bad += 1
    else:
        kinds[kind] = kinds.get(kind, 0) + 1
first = loader.wp(1)
print(json.dumps({"count": count, "command": first.command, "x": first.x, "kinds": kinds, "bad": bad}))
