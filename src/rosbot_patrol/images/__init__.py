"""Encodings of pictures: conversion between ROS messages, compressed bytes and numpy arrays."""
