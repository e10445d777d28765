"""What people and programs order: action, services, arming, emergency stop; and a kill right after a call."""

import json
import os
import signal
import time
import xmlrpc.client
from types import SimpleNamespace

import pytest
from patrol_house import ROOT, wait_until

rospy = pytest.importorskip("rospy", reason="needs ROS: source the workspace first")


def call(name, kind, *values):
    rospy.wait_for_service(name, 10)
    return rospy.ServiceProxy(name, kind)(*values)


def test_action_services_and_arming(house):
    import actionlib
    from rosbot_patrol.msg import Arming, PatrolAction, PatrolGoal
    from rosbot_patrol.srv import Arm
    from std_srvs.srv import Trigger

    (house.folder / "schedule.yaml").write_text("rounds: [{name: night, at: [25:00]}]")
    modes = []
    subscriber = rospy.Subscriber("/patrol/arming", Arming, modes.append)
    house.start_move_base()
    house.start_patrol(
        schedule=str(house.folder / "schedule.yaml"), arming=str(ROOT / "config" / "arming.yaml"), spin_speed=5.0
    )
    said = f"{house.folder}/schedule.yaml: rounds[0]/at[0]: is 1500, expected a time of day"
    assert said in house.log(house.patrol)

    client = actionlib.SimpleActionClient("patrol", PatrolAction)
    assert client.wait_for_server(rospy.Duration(10))
    client.send_goal_and_wait(PatrolGoal(rooms=[1, 99]))
    assert "there is no room 99" in client.get_goal_status_text()
    feedback = []
    client.send_goal(PatrolGoal(rooms=[2, 1]), feedback_cb=feedback.append)
    assert client.wait_for_result(rospy.Duration(60))
    result = client.get_result()
    assert (list(result.rooms), result.verdicts) == ([2, 1], ["clear", "clear"])
    assert result.text == "2 of 2 rooms have a verdict: nobody was confirmed"
    assert len(set(result.missions)) == 2
    assert {"driving", "looking"} <= {f.phase for f in feedback}
    assert house.states[-1].origin in ("action", "")

    client.send_goal(PatrolGoal())
    wait_until(lambda: house.states[-1].origin == "action", 20, "the round")
    client.cancel_goal()
    assert client.wait_for_result(rospy.Duration(10))
    assert "cancelled by the program" in client.get_goal_status_text()
    wait_until(lambda: house.states[-1].state == "idle", 20, "the rest")

    refused = call("/patrol/arm", Arm, "party")
    assert not refused.accepted
    assert "the mode 'party' is not known here" in refused.message
    assert call("/patrol/arm", Arm, "disarmed").accepted
    assert "the mode is disarmed now, it was armed_away; ordered by /patrol_test on this machine" in house.log(
        house.patrol
    )
    wait_until(lambda: any(mail["Subject"] == "rosbot patrol: disarmed" for mail in house.mails()), 20, "the mail")
    (mail,) = [mail for mail in house.mails() if mail["Subject"] == "rosbot patrol: disarmed"]
    plain = next(part for part in mail.walk() if part.get_content_type() == "text/plain").get_payload(decode=True)
    said = "Ordered by /patrol_test on this machine, by the service /patrol/arm, 20"
    assert said in " ".join(plain.decode().split())
    wait_until(lambda: modes and modes[-1].mode == "disarmed", 20, "the mode")
    house.send(1)
    wait_until(lambda: "the house is disarmed" in house.log(house.patrol), 20, "the word")
    assert house.states[-1].state == "idle"
    assert "the robot looks at the rooms 1, 2" in call("/patrol/all", Trigger).message
    wait_until(lambda: house.states[-1].origin == "all", 20, "the round")
    assert call("/patrol/home", Trigger).message.startswith("given up: room")
    wait_until(lambda: house.states[-1].why == "on guard, at home again", 20, "home")
    assert call("/patrol/cancel", Trigger).message == "there is nothing to give up"
    assert json.loads((house.folder / "state" / "arming.json").read_text())["mode"] == "disarmed"
    subscriber.unregister()


@pytest.mark.long
def test_the_emergency_stop_holds_over_a_kill(house):
    from std_msgs.msg import Bool
    from std_srvs.srv import SetBool

    locks = []
    subscriber = rospy.Subscriber("/e_stop", Bool, lambda message: locks.append(message.data))
    house.start_move_base(speed=0.5)
    house.start_patrol()
    house.send(7)
    wait_until(lambda: house.states[-1].state == "driving", 20, "the drive")
    house.twists.clear()
    assert call("/patrol/emergency_stop", SetBool, True).success
    wait_until(lambda: house.states[-1].state == "stopped", 5, "the stop")
    assert house.states[-1].last_verdict == "unverified"
    wait_until(lambda: locks and locks[-1], 5, "the base's lock")
    wait_until(lambda: len(house.twists) > 5, 5, "the zeros")
    assert not any(house.twists)
    house.send(1)
    wait_until(lambda: list(house.states[-1].queue) == [1], 20, "the queue")

    os.killpg(house.patrol.pid, signal.SIGKILL)
    house.patrol.wait()
    house.start_patrol(wait=False)
    wait_until(lambda: house.states and house.states[-1].state == "stopped", 20, "the stop, again")
    assert list(house.states[-1].queue) == [1]
    button = rospy.Publisher("/e_stop", Bool, queue_size=5)
    wait_until(lambda: button.get_num_connections() > 1, 20, "the subscription")
    locks.clear()
    button.publish(Bool(data=False))  # a button that nobody presses
    wait_until(lambda: len(locks) > 1 and locks[-1], 20, "the lock, closed again")
    assert house.states[-1].state == "stopped"

    assert call("/patrol/emergency_stop", SetBool, False).message == "released"
    wait_until(lambda: not locks[-1], 20, "the lock, open")
    assert house.wait_for_mission().last_verdict == "clear"
    button.unregister()
    subscriber.unregister()


def plain_text(mail):
    part = next(part for part in mail.walk() if part.get_content_type() == "text/plain")
    return " ".join(part.get_payload(decode=True).decode().split())


def start_watch(house):
    return house._start(
        ["rosrun", "rosbot_patrol", "sensor_watch", "__name:=sensor_watch"],
        {
            "path_to_params": str(ROOT / "params" / "room_points.yaml"),
            "state_dir": str(house.folder / "state"),
            "transport": "maildir",
            "maildir": str(house.folder / "mail"),
        },
    )


@pytest.mark.long
def test_a_patrol_that_was_made_deaf_says_so_and_hears_again(house):
    """Somebody signs the patrol off at the master; a bridge that starts again then does not find it."""
    from rosbot_patrol.msg import EspTrigger

    house.start_move_base()
    house.start_patrol()
    start_watch(house)
    master = xmlrpc.client.ServerProxy(os.environ["ROS_MASTER_URI"])
    patrol_uri = master.lookupNode("/test", "/patrolling_node")[2]
    patrol = xmlrpc.client.ServerProxy(patrol_uri)
    speaker = {"now": house.trigger}
    beat = rospy.Timer(rospy.Duration(0.25), lambda _: speaker["now"].publish(EspTrigger(id=1)))
    house.ends.append(SimpleNamespace(unregister=beat.shutdown))
    wait_until(lambda: "/motion_trigger" in str(patrol.getBusInfo("/test")), 20, "the link")
    time.sleep(6.0)  # the watch counts
    assert master.unregisterSubscriber("/patrolling_node", "/motion_trigger", patrol_uri)[2] == 1
    house.trigger.unregister()
    house.trigger = speaker["now"] = rospy.Publisher("/motion_trigger", EspTrigger, queue_size=10)
    wait_until(lambda: "the link was cut, listening anew" in house.log(house.patrol), 30, "the patrol's word")
    wait_until(lambda: "the motion sensors are heard again" in house.log(house.patrol), 20, "that it hears")
    wait_until(lambda: any("its link was cut" in plain_text(mail) for mail in house.mails()), 20, "a mail")


@pytest.mark.long
def test_what_was_called_while_the_patrol_was_down_is_looked_at(house):
    """The sensors' watch heard it."""
    from rosbot_patrol.msg import SensorStates

    heard = []
    house.ends.append(rospy.Subscriber("/sensors/states", SensorStates, heard.append))
    house.start_move_base()
    watch = start_watch(house)
    house.start_patrol()
    wait_until(lambda: heard, 20, "the sensors' watch")
    os.killpg(house.patrol.pid, signal.SIGKILL)
    house.patrol.wait()
    house.send(4)
    wait_until(lambda: any(s.id == 4 and s.motion >= 0.0 for s in heard[-1].sensors), 20, "that the watch has heard it")
    house.start_patrol(wait=False)
    last = house.wait_for_mission()
    assert {s.room_id for s in house.states if s.mission} == {4}
    assert last.last_verdict == "clear"
    assert "while the patrol was down" in house.log(house.patrol)
    assert watch.poll() is None


def test_a_kill_right_after_a_call_loses_nothing(house):
    rospy.set_param("/run_id", "one")
    house.start_move_base()
    house.start_patrol()
    calls = house.folder / "state" / "calls.jsonl"
    house.send(3)
    deadline = time.monotonic() + 10.0
    while not (calls.exists() and calls.stat().st_size) and time.monotonic() < deadline:
        pass
    os.killpg(house.patrol.pid, signal.SIGKILL)
    house.patrol.wait()
    rospy.set_param("/run_id", "two")  # the whole house was killed, and launched anew
    house.start_patrol(wait=False)
    last = house.wait_for_mission()
    assert {s.room_id for s in house.states if s.mission} == {3}
    assert last.last_verdict == "clear"
