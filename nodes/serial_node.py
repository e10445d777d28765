#!/usr/bin/env python3
from rosbot_patrol.ros.serial_server_node import main

main()
