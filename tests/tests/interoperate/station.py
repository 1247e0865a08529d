"""A ground station by MAVSDK: downloads mission and fence, imports files, says what it got, one JSON line at the end.

Usage: station.py PORT PLAN WAYPOINTS.
"""

import json
import sys

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.mission_raw import MissionRaw

mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
mavsdk.add_any_connection(f"udpin://127.0.0.1:{sys.argv[1]}")
system = mavsdk.first_autopilot(timeout_s=15.0)
assert system is not None, "no autopilot"
station = MissionRaw(system)


def brief(items):
    return [[item.command, item.x, item.y, item.z, item.frame] for item in items]


plan = station.import_qgroundcontrol_mission(sys.argv[2])
got = {
    "mission": brief(station.download_mission()),
    "fence": brief(station.download_geofence()),
    "plan": brief(plan.mission_items),
    "plan_fence": brief(plan.geofence_items),
    "waypoints": brief(station.import_mission_planner_mission(sys.argv[3]).mission_items),
}
print(json.dumps(got), flush=True)
