"""Tests of odometry."""
