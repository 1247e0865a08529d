"""A vehicle by pymavlink: takes and gives missions and fences, says what it got, one JSON line at the end.

Usage: vehicle.py PORT [KEY]. Ends when its standard input does.
"""

import json
import os
import select
import sys
import time

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil  # noqa: E402

MAV = mavutil.mavlink


def main():
    port = sys.argv[1]
    link = mavutil.mavlink_connection(
        f"udpout:127.0.0.1:{port}", source_system=1, source_component=1, dialect="ardupilotmega"
    )
    if len(sys.argv) > 2:
        link.setup_signing(bytes.fromhex(sys.argv[2]), sign_outgoing=True, link_id=3)
    lists = {0: [], 1: [], 2: []}
    receiving = None
    unsigned = signed = 0
    told = 0.0
    while not select.select([sys.stdin], [], [], 0)[0]:
        if time.monotonic() - told > 0.2:
            told = time.monotonic()
            link.mav.heartbeat_send(MAV.MAV_TYPE_QUADROTOR, MAV.MAV_AUTOPILOT_PX4, 0, 0, MAV.MAV_STATE_ACTIVE)
        message = link.recv_match(blocking=True, timeout=0.05)
        if message is None or message.get_type() == "BAD_DATA":
            continue
        if message.get_signed():
            signed += 1
        else:
            unsigned += 1
        kind, to = message.get_type(), (message.get_srcSystem(), message.get_srcComponent())
        if kind == "MISSION_COUNT":
            receiving = (message.mission_type, message.count, [])
            link.mav.mission_request_int_send(*to, 0, message.mission_type)
        elif kind == "MISSION_ITEM_INT" and receiving and message.mission_type == receiving[0]:
            what, count, items = receiving
            if message.seq == len(items):
                items.append(message)
            if len(items) < count:
                link.mav.mission_request_int_send(*to, len(items), what)
            else:
                lists[what], receiving = items, None
                link.mav.mission_ack_send(*to, MAV.MAV_MISSION_ACCEPTED, what)
        elif kind == "MISSION_CLEAR_ALL":
            lists[message.mission_type] = []
            link.mav.mission_ack_send(*to, MAV.MAV_MISSION_ACCEPTED, message.mission_type)
        elif kind == "MISSION_REQUEST_LIST":
            link.mav.mission_count_send(*to, len(lists[message.mission_type]), message.mission_type)
        elif kind == "MISSION_REQUEST_INT":
            item = lists[message.mission_type][message.seq]
            link.mav.mission_item_int_send(
                *to, item.seq, item.frame, item.command, item.current, item.autocontinue,
                item.param1, item.param2, item.param3, item.param4, item.x, item.y, item.z, item.mission_type,
            )
    items = {
        str(what): [[item.command, item.frame, item.x, item.y, round(item.z, 3), item.param1, item.param2] for item in kept]
        for what, kept in lists.items()
    }
    print(json.dumps({"lists": items, "signed": signed, "unsigned": unsigned}))


if __name__ == "__main__":
    main()
