"""Asks Debian's own darknet (package `darknet`, its shared library) what it sees, in a process of its own.

    darknet_reference.py CFG WEIGHTS PICTURE CLASSES THRESHOLD IOU [REPEAT]

The last line printed is JSON: the boxes after do_nms_obj as darknet_ros runs it (centre, size as shares of the picture,
objectness, probabilities), and the milliseconds of each forward pass, by the wall and of the processor.
"""

import ctypes
import json
import sys
import time

LIBRARY = "/usr/lib/darknet/libdarknet.so"


class Image(ctypes.Structure):
    _fields_ = [("w", ctypes.c_int), ("h", ctypes.c_int), ("c", ctypes.c_int), ("data", ctypes.POINTER(ctypes.c_float))]


class Box(ctypes.Structure):
    _fields_ = [(name, ctypes.c_float) for name in "xywh"]


class FoundBox(ctypes.Structure):
    _fields_ = [
        ("bbox", Box),
        ("classes", ctypes.c_int),
        ("prob", ctypes.POINTER(ctypes.c_float)),
        ("mask", ctypes.POINTER(ctypes.c_float)),
        ("objectness", ctypes.c_float),
        ("sort_class", ctypes.c_int),
    ]


def load_library():
    lib = ctypes.CDLL(LIBRARY)
    lib.load_network.restype = ctypes.c_void_p
    lib.load_network.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_int]
    lib.set_batch_network.argtypes = [ctypes.c_void_p, ctypes.c_int]
    lib.load_image_color.restype = Image
    lib.load_image_color.argtypes = [ctypes.c_char_p, ctypes.c_int, ctypes.c_int]
    lib.network_predict_image.argtypes = [ctypes.c_void_p, Image]
    lib.network_predict_image.restype = ctypes.POINTER(ctypes.c_float)
    lib.get_network_boxes.restype = ctypes.POINTER(FoundBox)
    lib.get_network_boxes.argtypes = [
        ctypes.c_void_p,
        ctypes.c_int,
        ctypes.c_int,
        ctypes.c_float,
        ctypes.c_float,
        ctypes.POINTER(ctypes.c_int),
        ctypes.c_int,
        ctypes.POINTER(ctypes.c_int),
    ]
    lib.do_nms_obj.argtypes = [ctypes.POINTER(FoundBox), ctypes.c_int, ctypes.c_int, ctypes.c_float]
    return lib


def main(cfg, weights, picture, classes, threshold, iou, repeat="1"):
    lib = load_library()
    network = lib.load_network(cfg.encode(), weights.encode(), 0)
    lib.set_batch_network(network, 1)
    image = lib.load_image_color(picture.encode(), 0, 0)
    times, processor = [], []
    for _ in range(int(repeat)):
        start, used = time.perf_counter(), time.process_time()
        lib.network_predict_image(network, image)
        times.append((time.perf_counter() - start) * 1e3)
        processor.append((time.process_time() - used) * 1e3)
    count = ctypes.c_int(0)
    found = lib.get_network_boxes(network, image.w, image.h, float(threshold), 0.5, None, 1, ctypes.byref(count))
    lib.do_nms_obj(found, count.value, int(classes), float(iou))
    boxes = []
    for item in (found[i] for i in range(count.value)):
        probabilities = item.prob[: int(classes)]  # the field `classes` is 0 for [region]
        if any(probabilities):
            box = [item.bbox.x, item.bbox.y, item.bbox.w, item.bbox.h]
            boxes.append({"box": box, "objectness": item.objectness, "probabilities": probabilities})
    print("\n" + json.dumps({"boxes": boxes, "ms": times, "cpu_ms": processor}))


if __name__ == "__main__":
    main(*sys.argv[1:])
