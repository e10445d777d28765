"""A ROS node driven by lines of JSON: commands on stdin, what it hears on stdout.

{"subscribe": [topic, type]}  {"advertise": [topic, type]}  {"publish": [topic, fields]}  {"linked": topic}
{"call": [service, type, arguments]}  {"serve": [service, type, answer]}  {"topics": prefix}
"""

import json
import sys
import threading

import genpy
import roslib.message
import rospy

lock = threading.Lock()
publishers = {}


def say(**what):
    with lock:
        print(json.dumps(what), flush=True)


def plain(value):
    return value if isinstance(value, bool | int | float | str) else genpy.message.strify_message(value)


def fields(message):
    return {slot: plain(getattr(message, slot)) for slot in message.__slots__}


def subscribe(topic, kind):
    rospy.Subscriber(topic, roslib.message.get_message_class(kind), lambda m: say(topic=topic, **fields(m)))


def advertise(topic, kind):
    publishers[topic] = rospy.Publisher(topic, roslib.message.get_message_class(kind), queue_size=10)


def linked(topic):
    """Until somebody listens to what is advertised there."""
    while not publishers[topic].get_num_connections() and not rospy.is_shutdown():
        rospy.rostime.wallsleep(0.05)


def publish(topic, values):
    message = publishers[topic].data_class()
    genpy.message.fill_message_args(message, [values])
    publishers[topic].publish(message)


def call(service, kind, arguments):
    cls = roslib.message.get_service_class(kind)
    try:
        rospy.wait_for_service(service, 5.0)
        request = cls._request_class()
        if arguments:
            genpy.message.fill_message_args(request, arguments)
        say(called=service, **fields(rospy.ServiceProxy(service, cls)(request)))
    except (rospy.ServiceException, rospy.ROSException) as err:
        say(called=service, error=str(err))


def serve(service, kind, answer):
    cls = roslib.message.get_service_class(kind)

    def handle(request):
        say(served=service, **fields(request))
        return cls._response_class(*answer)

    rospy.Service(service, cls, handle)


def topics(prefix):
    say(topics=[name for name, _ in rospy.get_published_topics() if name.startswith(prefix)])


def main():
    rospy.init_node("probe", anonymous=True, disable_signals=True)
    rospy.Subscriber("/rosout", roslib.message.get_message_class("rosgraph_msgs/Log"), lambda m: say(log=m.msg))
    say(ready=True)
    commands = {"subscribe": subscribe, "advertise": advertise, "publish": publish, "call": call, "serve": serve}
    for line in sys.stdin:
        for name, arguments in json.loads(line).items():
            if name == "topics":
                topics(arguments)
            elif name == "call":
                threading.Thread(target=call, args=arguments, daemon=True).start()
            elif name == "linked":
                linked(arguments)
            else:
                commands[name](*arguments)
        say(done=line.strip())


main()
