from rosbot_patrol.patrol.story.mission_story import AlertTelling, Narrator, Telling


def state(phase, why="", mission="m1", last=""):
    room = {"room_id": 3, "room_name": "kitchen"} if mission else {}
    return Telling(phase=phase, why=why, mission=mission, last_verdict=last, **room)


def alert(delivered, transport="maildir", location="/mail/new/1", mission="m1"):
    return AlertTelling(
        id=mission,
        room="room 3 (kitchen)",
        object_class="person",
        probability=0.91,
        delivered=delivered,
        transport=transport,
        location=location,
    )


def test_a_whole_patrol():
    n = Narrator()
    lines = []
    lines += n.state(0.0, state("starting", "waiting for move_base", mission=""))
    lines += n.state(1.0, state("idle", "on guard", mission=""))
    lines += n.trigger(3)
    lines += n.trigger(3)
    lines += n.state(2.0, state("driving", "driving to room 3 (kitchen)"))
    lines += n.state(2.5, state("driving", "driving to room 3 (kitchen)"))
    lines += n.state(9.0, state("looking", "arrived in room 3 (kitchen)"))
    lines += n.state(9.5, state("looking", "turning to look around, 0 of 360 degrees, in room 3 (kitchen)"))
    lines += n.state(9.9, state("looking", "turning to look around, 30 of 360 degrees, in room 3 (kitchen)"))
    lines += n.alert(alert(delivered=False))
    lines += n.alert(alert(delivered=True))
    lines += n.state(19.0, state("returning", "driving home, confirmed: person seen in room 3 (kitchen)"))
    lines += n.state(
        30.0, state("idle", "on guard, at home again; confirmed: person seen in room 3", mission="", last="confirmed")
    )
    assert lines == [
        "Not yet on guard: waiting for move_base.",
        "On guard.",
        "Motion sensor 3 calls.",
        "Driving to room 3 (kitchen).",
        "Arrived in room 3 (kitchen).",
        "Turning once to look around in room 3 (kitchen).",
        "INTRUDER: a person seen on the mission to room 3 (kitchen), probability 0.91. The notice is on disk.",
        "The mail lies in the Maildir /mail.",
        "Driving home. Confirmed: person seen in room 3 (kitchen).",
        "Home again. Verdict for room 3 (kitchen): confirmed.",
        "On guard (at home again; confirmed: person seen in room 3).",
    ]
    (mission,) = n.summary()["missions"]
    assert mission["mails"] == ["/mail/new/1"]
    assert mission["seen"] == ["person"]
    assert mission["times"] == {"driving": 2.0, "looking": 9.0, "returning": 19.0, "end": 30.0}
    assert n.ended == 1
    assert n.is_complete(n.missions[0])


def test_a_confirmed_mission_is_told_only_with_its_mail():
    n = Narrator()
    n.state(1.0, state("driving"))
    n.state(2.0, state("idle", mission="", last="confirmed"))
    assert not n.is_complete(n.missions[0])
    n.alert(alert(delivered=True))
    assert n.is_complete(n.missions[0])


def test_a_mail_that_was_sent_says_to_whom():
    assert Narrator().alert(alert(delivered=True, transport="smtp", location="a@b.org")) == [
        "The mail was sent to a@b.org by smtp."
    ]


def test_on_guard_is_said_once_and_a_silent_detector_with_it():
    n = Narrator()
    assert n.state(1.0, state("idle", "on guard; the detector is silent", mission="")) == [
        "On guard (the detector is silent)."
    ]
    assert n.state(2.0, state("idle", "on guard", mission="")) == []


def test_a_robot_that_is_not_home_is_not_said_to_be():
    n = Narrator()
    n.state(1.0, state("returning"))
    lines = n.state(2.0, state("idle", "on guard, not at home (move_base gave up)", mission="", last="clear"))
    assert lines[0] == "Not home. Verdict for room 3 (kitchen): clear."
    assert not n.is_home


def test_a_wait_for_move_base_in_a_mission_is_said():
    n = Narrator()
    n.state(1.0, state("returning", "driving home"))
    assert n.state(2.0, state("returning", "waiting for move_base to drive to home")) == [
        "Waiting for move_base to drive to home."
    ]


def test_a_narrator_that_comes_late_tells_from_there():
    n = Narrator()
    assert n.state(1.0, state("returning", "driving home, clear: nobody")) == ["Driving home. Clear: nobody."]
    assert n.alert(alert(delivered=True, mission="another"))
