"""A vehicle by MAVSDK: takes missions, says what it got, one JSON line at the end.

Usage: mavsdk_vehicle.py PORT. Ends when its standard input does.
"""

import json
import sys

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.mission_raw_server import MissionRawServer

mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.AUTOPILOT))
mavsdk.add_any_connection(f"udpout://127.0.0.1:{sys.argv[1]}")
server = MissionRawServer(mavsdk.server_component_by_type(ComponentType.AUTOPILOT))
got = []
server.subscribe_incoming_mission(
    lambda result, plan, _: got.append([[item.command, item.frame, item.x, item.y, item.z] for item in plan.mission_items])
)
sys.stdin.read(1)
print(json.dumps({"got": got}), flush=True)
