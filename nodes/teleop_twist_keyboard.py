#!/usr/bin/env python3
from rosbot_patrol.ros.drive.teleop_node import main

main()
