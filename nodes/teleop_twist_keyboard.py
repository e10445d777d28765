#!/usr/bin/env python3
from rosbot_patrol.ros.teleop_node import main

main()
