"""The values that all codecs are given, in plain types: a run of the mill of each."""

from typing import Any

HEADER = {
    "seq": 123_456,
    "boot": 5_276_140_391_772_104_117,
    "t_ns": 1_767_225_600_123_456_789,
    "mono_ns": 86_400_123_456_789,
    "host": 8_120_004_815_162_342_109,
}

# By frame: what stands in its payload, velocities with their sign.
FRAMES: dict[str, tuple[Any, ...]] = {
    "velocity report": (-1000, 250),
    "run command": (1, 500, -300),
    "bumper report": (True,),
    "ultrasonic report": (100, 200, 300, 400, 500, 600, 0xFFFF, 5000),
}

MESSAGES: dict[str, dict[str, Any]] = {
    "Velocity": {**HEADER, "linear": -0.987, "angular": 0.436},
    "Bumper": {**HEADER, "pressed": True, "lost": 0},
    "Ultrasonic": {
        **HEADER,
        "ranges": (1.234, 0.8, None, 2.05, 3.141, None, 4.2, 0.62),
        "status": ("ok", "ok", "no_echo", "ok", "ok", "fault", "ok", "ok"),
    },
    "Motion": {
        **HEADER,
        "command": "run",
        "linear": 0.8,
        "angular": -0.25,
        "source": "teleop",
        "judged": 98_765,
        "judged_boot": 6_917_529_027_641_081_856,
        "latched": False,
        "predecessor": None,
        "asked_ns": 86_400_103_456_789,
        "heard_ns": 86_400_113_456_789,
        "judged_ns": 86_400_118_456_789,
    },
    "SafetyState": {
        **HEADER,
        "verdict": "slow",
        "latched": ("contact",),
        "causes": (
            {
                "name": "contact",
                "action": "brake",
                "age": 1.25,
                "text": "the bumper was pressed; reset to drive on",
                "id": 4_712,
            },
            {
                "name": "near",
                "action": "slow",
                "age": 0.4,
                "text": "0.62 m ahead on the left",
                "id": 4_713,
            },
        ),
        "source": "teleop",
        "limits": {"forward": 0.3, "backward": 0.5, "angular": 0.8},
        "heartbeat": 4_711,
        "text": "slowed down: 0.62 m ahead on the left",
        "release": None,
    },
    "Odometry": {
        **HEADER,
        "x": 12.345,
        "y": -6.789,
        "heading": 1.5707,
        "linear": 0.81,
        "angular": -0.12,
        "pose_covariance": (0.01, 0.001, 0.0, 0.001, 0.02, 0.0, 0.0, 0.0, 0.03),
        "twist_covariance": (0.004, 0.0, 0.0, 0.009),
        "epoch": 3,
        "residual": 0.0042,
        "slip": False,
        "frame_id": "odom",
        "child_frame_id": "base_link",
    },
}
