#!/usr/bin/env python3
from rosbot_patrol.ros.bridge.node import main

main()
