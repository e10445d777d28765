"""The camera before the detector, or the picture before republish, and the listener behind it; prints lines of JSON.

    camera_client.py SCENARIO [PHOTOGRAPH]

One process a scenario, because rospy knows one master in its life. The network of the tests sees a person where a
picture is red and a fire hydrant where it is blue.
"""

import json
import sys
import time

import actionlib
import cv2
import dynamic_reconfigure.client
import numpy as np
import roslib.message
import rospy
import rosservice
from actionlib import CommState
from actionlib_msgs.msg import GoalStatus
from darknet_ros_msgs.msg import BoundingBoxes, CheckForObjectsAction, CheckForObjectsGoal, ObjectCount
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from rosbot_patrol.images.compressed import CompressedParams, compress
from rosbot_patrol.images.encodings import ENCODINGS, Picture
from rosbot_patrol.ros.messages.images import picture_from_msg, picture_to_msg

CAMERA = "/camera/rgb/image_raw"
COLOURS = {"red": (255, 0, 0), "blue": (0, 0, 255), "black": (0, 0, 0)}


def say(**what):
    print(json.dumps(what), flush=True)


def make_picture(colour="red", encoding="rgb8"):
    """Black but for 10 x 10 pixels at (14, 22): the network looks at each eighth pixel, here at (16, 24)."""
    pixels = np.zeros((64, 64, 3), dtype=np.uint8)
    pixels[22:32, 14:24] = COLOURS[colour]
    if encoding in ("mono8", "rgb8", "bgr8"):
        return Picture(pixels, "rgb8").to(encoding)
    known = ENCODINGS[encoding]
    scale = 257 if known.dtype == "u2" else 1
    if encoding.startswith("bayer"):
        tile = np.array(["rgb".index(letter) for letter in encoding[6:10]]).reshape(2, 2)
        mosaic = np.take_along_axis(pixels, np.tile(tile, (32, 32))[:, :, None], axis=2)
        return Picture(mosaic.astype(known.dtype) * scale, encoding)
    if encoding.startswith("yuv"):
        y, u, v = cv2.split(cv2.cvtColor(pixels, cv2.COLOR_RGB2YUV))
        # OpenCV's YUV spans 0 to 255, a camera's 16 to 235; colours stay the same
        y, u, v = (16 + y * 0.859).astype(np.uint8), u[:, ::2], v[:, ::2]
        pairs = np.stack([u, y[:, ::2], v, y[:, 1::2]] if encoding == "yuv422" else [y[:, ::2], u, y[:, 1::2], v], 2)
        return Picture(pairs.reshape(64, 64, 2), encoding)
    if known.channels == 1:
        return Picture(pixels[:, :, :1].astype(known.dtype) * scale, encoding)
    picture = np.zeros((64, 64, known.channels), dtype=known.dtype)
    picture[:, :, list(known.order)] = pixels.astype(known.dtype) * scale
    return Picture(picture, encoding)


def make_message(stamp, colour="red", encoding="rgb8"):
    message = picture_to_msg(make_picture(colour, encoding), rospy.Header())
    message.header.stamp, message.header.frame_id = rospy.Time(stamp), "camera_optical"
    return message


class Client:
    """A camera, and everything heard from the detector."""

    def __init__(self, *, topic=CAMERA, kind=Image, drawn=False):
        self.heard = {"boxes": [], "count": [], "drawn": [], "ok": [], "health": []}
        self.camera = rospy.Publisher(topic, kind, queue_size=10)
        self._listen("/darknet_ros/bounding_boxes", BoundingBoxes, "boxes")
        self._listen("/darknet_ros/found_object", ObjectCount, "count")
        self._listen("/darknet_ros/camera_ok", Bool, "ok")
        self._listen("/diagnostics", DiagnosticArray, "health")
        if drawn:
            self._listen("/darknet_ros/detection_image", Image, "drawn")
        self.wait(lambda: self.camera.get_num_connections() > 0, 20.0)
        time.sleep(0.5)

    def _listen(self, topic, kind, name):
        subscriber = rospy.Subscriber(topic, kind, self.heard[name].append)
        if name in ("boxes", "count"):
            self.wait(lambda: subscriber.get_num_connections() > 0, 20.0)

    def wait(self, condition, seconds=5.0):
        until = time.monotonic() + seconds
        while not condition() and time.monotonic() < until:
            time.sleep(0.01)
        return condition()

    def look(self, message):
        """Send one picture and wait for its count; then the boxes that came with it."""
        counts, boxes = len(self.heard["count"]), len(self.heard["boxes"])
        self.camera.publish(message)
        self.wait(lambda: len(self.heard["count"]) > counts, 3.0)
        if any(each.count for each in self.heard["count"][counts:]):  # the boxes come on a topic of their own
            self.wait(lambda: len(self.heard["boxes"]) > boxes, 3.0)
        time.sleep(0.1)
        return self.heard["count"][counts:], self.heard["boxes"][boxes:]


def describe(boxes):
    return [[b.Class, b.id, b.xmin, b.ymin, b.xmax, b.ymax, round(b.probability, 2)] for b in boxes.bounding_boxes]


def boxes():
    client = Client(drawn=True)
    counts, found = client.look(make_message(100))
    message = found[0]
    say(
        boxes=describe(message),
        stamp=message.header.stamp.secs,
        frame=message.header.frame_id,
        image_stamp=message.image_header.stamp.secs,
        image_frame=message.image_header.frame_id,
        counts=[c.count for c in counts],
        count_stamp=counts[0].header.stamp.secs,
    )
    client.wait(lambda: client.heard["drawn"])
    drawn = client.heard["drawn"][0]
    say(
        drawn=[drawn.encoding, drawn.header.stamp.secs, drawn.width],
        colour=picture_from_msg(drawn).pixels[28, 20].tolist(),
    )
    say(again=len(client.look(make_message(100))[0]))
    counts, found = client.look(make_message(101, "black"))
    say(nothing=[c.count for c in counts], messages=len(found))


def empty():
    found = Client().look(make_message(100, "black"))[1]
    say(messages=[describe(m) for m in found])


def encodings():
    client = Client()
    for i, encoding in enumerate(ENCODINGS):
        if encoding not in ("16UC1", "32FC1"):
            counts, found = client.look(make_message(100 + i, "blue", encoding))
            say(encoding=encoding, counts=[c.count for c in counts], boxes=[describe(m) for m in found])


def nonsense():
    """Pictures that make no sense, one after the other, and then one that does."""
    client = Client()
    broken = [make_message(200 + i) for i in range(8)]
    broken[0].encoding = "nv21"
    broken[1].data = broken[1].data[:100]
    broken[2].step = 7
    broken[3].width = 0
    broken[4] = make_message(204, encoding="32FC1")
    broken[4].data = np.full(64 * 64, np.nan, np.float32).tobytes()
    broken[5].width, broken[5].height, broken[5].step, broken[5].data = 1, 1, 3, b"\xff\x00\x00"
    broken[6].height = 2**32 - 1
    broken[7].encoding = ""
    for message in broken:
        counts, found = client.look(message)
        part = [s for m in client.heard["health"] for s in m.status if s.name.endswith("camera")]
        say(counts=[c.count for c in counts], boxes=len(found), health=[part[-1].level, part[-1].message])
    say(alive=[describe(m) for m in client.look(make_message(300, "blue"))[1]])


def contract():
    """What others see of the node's topics."""
    Client(drawn=True)
    topics = dict(rospy.get_published_topics("/darknet_ros"))
    say(topics={name: [kind, roslib.message.get_message_class(kind)._md5sum] for name, kind in topics.items()})
    say(services=[name for name in rosservice.get_service_list("/darknet_ros") if not name.endswith("_logger_level")])


def latching():
    """What somebody hears who comes when all is over."""
    client = Client(drawn=True)
    client.look(make_message(100))
    client.wait(lambda: client.heard["drawn"])
    client.wait(lambda: any(m.data for m in client.heard["ok"]))  # the camera is looked at twice a second
    late = Client(drawn=True)
    time.sleep(0.5)
    say(late={name: [m.header.stamp.secs for m in late.heard[name]] for name in ("boxes", "count", "drawn")})
    say(ok=[m.data for m in late.heard["ok"]])


def undrawn():
    """A picture that nobody wanted to see drawn is not there for who comes later."""
    client = Client()
    client.look(make_message(100))
    late = Client(drawn=True)
    time.sleep(0.5)
    say(late=len(late.heard["drawn"]))


def hog():
    """Somebody who stands, drawn into a room, and nobody."""
    client = Client()
    for stamp, people in ((100, 1), (101, 0)):
        room = np.full((480, 640, 3), 190, dtype=np.uint8)
        if people:
            for start, end, thick in (
                ((0, 45), (0, 120), 44),
                ((-12, 120), (-18, 235), 22),
                ((12, 120), (18, 235), 22),
            ):
                cv2.line(room, (400 + start[0], 150 + start[1]), (400 + end[0], 150 + end[1]), (40, 40, 50), thick)
            cv2.circle(room, (400, 168), 16, (70, 80, 120), -1)
        message = picture_to_msg(Picture(room, "rgb8"), rospy.Header())
        message.header.stamp = rospy.Time(stamp)
        counts, found = client.look(message)
        say(counts=[c.count for c in counts], boxes=[describe(m) for m in found])


def photograph():
    """A photograph, and which network the detector says it has."""
    client = Client()
    message = picture_to_msg(Picture(cv2.imread(sys.argv[2]), "bgr8"), rospy.Header())
    message.header.stamp = rospy.Time(100)
    found = client.look(message)[1]
    client.wait(lambda: client.heard["health"])
    states = [s for m in client.heard["health"] for s in m.status if s.name == "darknet_ros: network"]
    network = {value.key: value.value for value in states[-1].values}["network"]
    classes = [box.Class for boxes in found for box in boxes.bounding_boxes]
    say(classes=classes, network=[states[-1].level, network])


def compressed():
    """A jpeg that is none, one that ends too soon, then a good one."""
    client = Client(topic=CAMERA + "/compressed", kind=CompressedImage)
    text, data = compress(make_picture(), CompressedParams(format="png"))
    message = CompressedImage(format=text, data=b"\xff\xd8 broken")
    message.header.stamp = rospy.Time(90)
    client.look(message)
    _, jpeg = compress(make_picture(), CompressedParams())
    message = CompressedImage(format="rgb8; jpeg compressed bgr8", data=jpeg[: len(jpeg) // 3])
    message.header.stamp = rospy.Time(91)
    client.look(message)
    message = CompressedImage(format=text, data=data)
    message.header.stamp = rospy.Time(100)
    say(boxes=[describe(m) for m in client.look(message)[1]])


def action():
    client = Client()
    server = actionlib.ActionClient("/darknet_ros/check_for_objects", CheckForObjectsAction)
    server.wait_for_server()
    client.look(make_message(50, "red"))
    handles = [
        server.send_goal(CheckForObjectsGoal(id=7, image=make_message(100, "blue"))),
        server.send_goal(CheckForObjectsGoal(id=8, image=make_message(101, "red"))),
        server.send_goal(CheckForObjectsGoal(id=9, image=Image())),
    ]
    for handle in handles:
        client.wait(lambda h=handle: h.get_goal_status() > GoalStatus.ACTIVE)
        time.sleep(0.2)
        result = handle.get_result()
        say(
            status=handle.get_goal_status(),
            text=handle.get_goal_status_text(),
            id=result.id,
            stamp=result.bounding_boxes.image_header.stamp.secs,
            boxes=describe(result.bounding_boxes),
        )


def preempt():
    """Many goals at once: one that waits when it is cancelled is preempted, and the node goes on."""
    client = Client()
    server = actionlib.ActionClient("/darknet_ros/check_for_objects", CheckForObjectsAction)
    server.wait_for_server()
    large = Image(height=1500, width=2000, step=6000, encoding="rgb8", data=bytes(9_000_000))

    def cancel(handle):  # once it is known: its cancel goes by another connection, and is not to overtake it
        if handle.get_comm_state() in (CommState.PENDING, CommState.ACTIVE):
            handle.cancel()

    def play():
        goals = [CheckForObjectsGoal(id=i, image=large) for i in range(8)]
        handles = [server.send_goal(goal, cancel if goal is goals[-1] else None) for goal in goals]
        client.wait(lambda: all(h.get_goal_status() > GoalStatus.ACTIVE for h in handles), 20.0)
        return [h.get_goal_status() for h in handles]

    status = next((found for found in (play() for _ in range(5)) if found[-1] != GoalStatus.SUCCEEDED), [])
    say(status=status)  # empty: it was always faster than the cancel
    say(alive=[describe(m) for m in client.look(make_message(300))[1]])


def switch():
    client = Client()
    enable = rospy.ServiceProxy("/darknet_ros/enable", SetBool)
    say(off=enable(False).success, counts=len(client.look(make_message(100))[0]))
    enable(True)
    say(counts=len(client.look(make_message(101))[0]))


def standby():
    """Another detector is there, goes, and comes back."""
    client = Client()
    other = rospy.Publisher("/darknet_ros/found_object", ObjectCount, queue_size=1)

    def play(seconds, *, with_other):
        before, until, stamp = len(client.heard["count"]), time.monotonic() + seconds, len(client.heard["count"]) + 100
        while time.monotonic() < until:
            stamp += 1
            client.camera.publish(make_message(stamp))
            if with_other:
                other.publish(ObjectCount(count=0))
            time.sleep(0.05)
        time.sleep(0.2)
        return sum(m._connection_header["callerid"] == "/darknet_ros" for m in client.heard["count"][before:])

    client.wait(lambda: other.get_num_connections() > 1)
    play(0.5, with_other=True)
    for with_other in (True, False, True, True):
        say(with_other=with_other, looked_at=play(1.5, with_other=with_other))
        if not with_other:
            told = [[s.level, s.message] for m in client.heard["health"] for s in m.status if "standing in" in s.name]
            say(health=told[-1])


def silent():
    """A camera that goes on with one picture, stops, and comes back."""
    client = Client()
    until = time.monotonic() + 2.5
    while time.monotonic() < until:
        client.camera.publish(make_message(100))
        time.sleep(0.05)
    say(frozen=[m.data for m in client.heard["ok"]])
    client.wait(lambda: "stopped" in str(client.heard["health"][-1:]), 5.0)
    say(health=[[s.level, s.message] for s in client.heard["health"][-1].status if s.name.endswith("camera")])
    client.look(make_message(101))
    client.wait(lambda: client.heard["ok"][-1].data, 3.0)
    say(ok=client.heard["ok"][-1].data)


def newest():
    """30 pictures at once: the newest is looked at, without working off the rest."""
    client = Client()
    for i in range(30):
        client.camera.publish(make_message(100 + i))
    client.wait(lambda: client.heard["count"] and client.heard["count"][-1].header.stamp.secs == 129)
    time.sleep(0.5)
    say(stamps=[m.header.stamp.secs for m in client.heard["count"]])


def republish():
    """A picture into /in, and what comes out of /middle/compressed and /out."""
    heard = []
    rospy.Subscriber("/middle/compressed", CompressedImage, lambda m: heard.append(("compressed", m)))
    rospy.Subscriber("/out", Image, lambda m: heard.append(("raw", m)))
    source = rospy.Publisher("/in", Image, queue_size=1)
    until = time.monotonic() + 15.0
    while len({kind for kind, _ in heard}) < 2 and time.monotonic() < until:
        source.publish(make_message(100))
        time.sleep(0.1)
    for kind in ("compressed", "raw"):
        message = next(m for k, m in heard if k == kind)
        text = message.format if kind == "compressed" else message.encoding
        say(kind=kind, text=text, stamp=message.header.stamp.secs, frame=message.header.frame_id)
    pixel = picture_from_msg(next(m for k, m in heard if k == "raw")).pixels[28, 20]
    say(pixel=pixel.tolist(), start=next(m for k, m in heard if k == "compressed").data[:4].hex())


def depth():
    """A depth picture into /in, and what comes out of /deep/compressedDepth and /out."""
    heard = {}
    rospy.Subscriber("/deep/compressedDepth", CompressedImage, lambda m: heard.setdefault("compressed", m))
    rospy.Subscriber("/out", Image, lambda m: heard.setdefault("raw", m))
    source = rospy.Publisher("/in", Image, queue_size=1)
    values = np.linspace(0.5, 9.0, 64 * 64, dtype=np.float32).reshape(64, 64, 1)
    values[0, 0] = np.nan
    message = picture_to_msg(Picture(values, "32FC1"), rospy.Header(stamp=rospy.Time(100)))
    until = time.monotonic() + 15.0
    while len(heard) < 2 and time.monotonic() < until:
        source.publish(message)
        time.sleep(0.1)
    back = picture_from_msg(heard["raw"])
    worst = float(np.nanmax(np.abs(back.pixels - values)))
    say(text=heard["compressed"].format, encoding=back.encoding, worst=worst, unknown=int(np.isnan(back.pixels).sum()))


def tuning():
    """The quality of a jpeg, changed while it runs; and a colour picture as depth."""
    heard = []
    rospy.Subscriber("/middle/compressed", CompressedImage, heard.append)
    rospy.Subscriber("/middle/compressedDepth", CompressedImage, lambda _: None)
    source = rospy.Publisher("/in", Image, queue_size=1)
    pixels = np.random.default_rng(0).integers(0, 255, (64, 64, 3), dtype=np.uint8)
    message = picture_to_msg(Picture(pixels, "rgb8"), rospy.Header())
    client = dynamic_reconfigure.client.Client("/middle/compressed", timeout=10.0)
    for quality in (90, 5):
        client.update_configuration({"jpeg_quality": quality})
        heard.clear()
        until = time.monotonic() + 10.0
        while len(heard) < 3 and time.monotonic() < until:
            source.publish(message)
            time.sleep(0.1)
        say(quality=quality, bytes=len(heard[-1].data))


if __name__ == "__main__":
    rospy.init_node("camera_client", disable_signals=True)
    globals()[sys.argv[1]]()
    say(done=True)
