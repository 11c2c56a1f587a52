"""Catalogue of the texts of causes, events and refusals, in English and Chinese, with remedies.

``t2.words`` renders them; the placeholders are explained there. A name has its text here and nowhere
else. The tables of causes and events in the documents are generated from this file.
"""

from typing import Any, NamedTuple

from t2 import log_texts, patrol_texts
from t2.messages import CauseName, EventName
from t2.patrol_texts import Words


class Entry(NamedTuple):
    """A text, and the next step for whoever reads it."""

    text: Words
    remedy: Words


class EventRow(NamedTuple):
    """An event: who publishes it, with which levels, what it means, and the next step."""

    services: str
    name: EventName
    levels: str
    text: Words
    remedy: Words


NOTHING: Words = ("nothing to do", "无需处理")
RESET: Words = (
    "when it is safe: `t2 call safety/reset`, or R in `t2 drive`",
    "确认安全后：`t2 call safety/reset`，或在 `t2 drive` 中按 R",
)


def then_reset(english: str, chinese: str) -> Words:
    """Return a remedy that ends with a reset."""
    return f"{english}; {RESET[0]}", f"{chinese}；{RESET[1]}"


BOARD_SENDS: Words = (
    "the board does not send it: check the board; `t2 hz` shows the rate",
    "主控板未发送数据：请检查主控板；`t2 hz` 显示频率",
)
BOARD_LOST: Words = (
    "check the board's power and cable; the link recovers by itself",
    "请检查主控板的电源和线缆；连接会自动恢复",
)
FREE_BUMPER: Words = (
    "free it; if that is impossible: `t2 drive`, hold F or B, away from it; then reset",
    "请移开障碍物；若无法移开：在 `t2 drive` 中按住 F 或 B 远离障碍物，然后复位",
)
DRIVER: Words = (
    "check the wheel (over current), the encoder's cable (encoder) or the battery (under voltage); "
    "switch the vehicle off and on; then reset",
    "请检查车轮（过流）、编码器线缆（编码器）或电池（欠压）；将车辆断电后重新上电，然后复位",
)
START: Words = (
    "on the robot: `t2 up`; beside a running stack `t2 up --only NAME`, with systemd `systemctl "
    "start t2-NAME`; if its process exists, it hangs: kill it",
    "在机器人上运行 `t2 up`；若其他服务已在运行，用 `t2 up --only NAME`，systemd 用 `systemctl start t2-NAME`；"
    "若进程存在，则已停止响应：请终止该进程",
)
WHO_LIMITS: Words = (
    "`t2 echo safety/state --field limit_sources` shows which program limits, and why",
    "`t2 echo safety/state --field limit_sources` 显示限速程序及其理由",
)
DRIVE_AGAIN: Words = ("let go of the controls, then drive", "请松开操纵装置，再驾驶")
OWN_SWITCH: Words = (
    "**use the vehicle's own switch**; then `t2 doctor`",
    "**请使用车身上的急停开关**；然后运行 `t2 doctor`",
)

# By the names of safety's table, ``services/safety/core/causes.py``.
CAUSES: dict[CauseName, Entry] = {
    "contact": Entry(("The bumper was hit.", "防撞条已触发。"), FREE_BUMPER),
    "estop": Entry(
        ("Emergency stop.", "急停。"),
        then_reset("find out who requested it, and why", "请查明由谁、因何急停"),
    ),
    "estop_reader": Entry(
        (
            "The emergency stop could not be received for a while.",
            "曾有一段时间无法接收急停信号。",
        ),
        then_reset(
            "safety had lost its connection: if frequent, check the router's log and the load of the computer",
            "安全服务的连接曾中断：若频繁出现，请检查路由器日志和计算机负载",
        ),
    ),
    "estop_keepalive": Entry(
        ("The emergency stop is no longer kept alive.", "急停维持信号中断。"),
        then_reset(
            "start its pendant, page or `t2 estop --keepalive NAME`",
            "请重新启动其手持终端、页面或 `t2 estop --keepalive NAME`",
        ),
    ),
    "predecessor": Entry(
        ("Safety restarted while a reset was due.", "安全服务已重启，仍需复位。"),
        then_reset("find the earlier cause in the log", "请在日志中查找此前的原因"),
    ),
    "runaway": Entry(
        ("The vehicle did not move as commanded.", "车辆未按指令运动。"),
        then_reset(
            "check the wheels, the ground, and the angular units in [wire]",
            "请检查车轮、地面以及 [wire] 中的角速度单位",
        ),
    ),
    "uncommanded_motion": Entry(
        ("The vehicle moved while standstill was commanded.", "停止指令期间车辆发生移动。"),
        then_reset(
            "check for a push, a slope, the brakes", "请检查是否被推动、是否有坡度以及制动器"
        ),
    ),
    "not_stopping": Entry(
        ("Standstill is not confirmed.", "车辆停止未得到确认。"),
        (
            "use the switch on the vehicle; then check its brakes and the ground",
            "请使用车身上的急停开关；然后检查制动器和地面",
        ),
    ),
    "driver_left": Entry(
        ("The left motor driver reported a fault.", "左侧电机驱动器报告故障。"), DRIVER
    ),
    "driver_right": Entry(
        ("The right motor driver reported a fault.", "右侧电机驱动器报告故障。"), DRIVER
    ),
    "flapping": Entry(
        ("Inputs failed repeatedly.", "输入信号反复失效。"),
        then_reset(
            "find the input that is intermittent (t2 echo evt/safety)",
            "请查找时断时续的输入（t2 echo evt/safety）",
        ),
    ),
    "leaving": Entry(("The safety service is shutting down.", "安全服务正在关闭。"), START),
    "starting": Entry(
        ("Waiting for the first samples.", "正在等待首批数据。"),
        (
            "wait; if it lasts, the board does not send it: check the board",
            "请等待；若持续，则主控板未发送数据：请检查主控板",
        ),
    ),
    "link": Entry(("The link to the board is down.", "与主控板的连接已断开。"), BOARD_LOST),
    "switches": Entry(
        ("The board's emergency brakes are not verified.", "主控板的紧急制动尚未确认。"),
        (
            """t2 call bridge/switches '{"ultrasonic_brake": true, "bumper_brake": true}'""",
            """t2 call bridge/switches '{"ultrasonic_brake": true, "bumper_brake": true}'""",
        ),
    ),
    "bumper": Entry(("The bumper is not being read.", "读不到防撞条。"), BOARD_SENDS),
    "silent": Entry(("An input is too old.", "输入数据过旧。"), BOARD_SENDS),
    "unarmed": Entry(
        ("The bridge is not armed yet.", "桥接服务尚未就绪。"),
        (
            "see the link above: the bridge reports what it waits for",
            "见上方的连接：桥接服务会报告其等待的条件",
        ),
    ),
    "limit_stop": Entry(
        ("A program that limits the speed stops the vehicle.", "限速程序要求停车。"),
        (
            f"clear the area; then {DRIVE_AGAIN[0]}; {WHO_LIMITS[0]}",
            f"请清空区域；然后{DRIVE_AGAIN[1]}；{WHO_LIMITS[1]}",
        ),
    ),
    "limit_silent": Entry(
        ("A program that limits the speed is silent.", "收不到限速程序的消息。"),
        (
            "start its program, check its network and certificate; see safety.limits",
            "请启动其程序，检查其网络和证书；见 safety.limits",
        ),
    ),
    "two_publishers": Entry(
        ("Two programs send under one name.", "两个程序以同一名称发送。"),
        (
            "stop one of both: `t2 echo '@cmd/**' --json` shows boot and host of each",
            "请停止其中一个：`t2 echo '@cmd/**' --json` 显示各自的 boot 和 host",
        ),
    ),
    "neutral": Entry(
        ("Let go of the controls, then drive.", "请先松开操纵装置，再驾驶。"),
        DRIVE_AGAIN,
    ),
    "blocked": Entry(
        ("No room in that direction.", "该方向空间不足。"),
        ("drive another way, or remove the obstacle", "请向其他方向行驶，或移开障碍物"),
    ),
    "no_request": Entry(("No command to drive.", "没有行驶指令。"), NOTHING),
    "release": Entry(("Creeping off the bumper.", "正在缓慢脱离碰撞。"), NOTHING),
    "limit": Entry(("Slowed by a program that limits the speed.", "因限速程序减速。"), WHO_LIMITS),
    "obstacle": Entry(
        ("Slowed by an obstacle.", "因障碍物减速。"),
        ("nothing to do: it drives on past it", "无需处理：驶过后恢复速度"),
    ),
    "sonar": Entry(
        ("A sonar cannot be trusted.", "有超声波传感器不可信。"),
        (
            "check the cable of a faulty one, or remove what covers it; it blocks its sector",
            "请检查故障传感器的线缆，或移开遮挡物；该方向被禁止行驶",
        ),
    ),
}

# Texts of causes with their figures, next steps, refusals and answers. The first part of a name is
# that of the cause or the call.
PHRASES: dict[str, Words] = {
    # why a cause holds
    "starting.missing": (
        "Waiting for the first sample of: {inputs:word}.", "正在等待首批数据：{inputs:word}。",
    ),
    "starting.keepalives": (
        "Waiting for the emergency stop keepalive of {names}.", "正在等待 {names} 的急停维持信号。",
    ),
    "silent.old": ("No recent data: {inputs:word}.", "以下数据过旧：{inputs:word}。"),
    "silent.stalled": (
        "Safety was stalled: samples received meanwhile may be old.",
        "安全服务曾停顿：其间收到的采样可能过旧。",
    ),
    "estop_reader.stalled": (
        "Safety was stalled: an emergency stop may have been missed.",
        "安全服务曾停顿：可能漏收了急停。",
    ),
    "estop_keepalive.lost": (
        "The emergency stop is no longer kept alive by {names}.", "{names} 的急停维持信号中断。",
    ),
    "predecessor.moved": (
        "The vehicle moved without a command while safety was absent.",
        "安全服务未运行时，车辆在无指令的情况下移动。",
    ),
    "not_stopping.speed": (
        "The vehicle does not stop: {linear:.2f} m/s, {angular:.2f} rad/s.",
        "车辆未能停住：{linear:.2f} m/s，{angular:.2f} rad/s。",
    ),
    "driver.faults": (
        "The {side:word} motor driver reports: {faults:word}.",
        "{side:word}侧电机驱动器报告：{faults:word}。",
    ),
    "driver.no_fault": (
        "The {side:word} motor driver reports no fault.", "{side:word}侧电机驱动器无故障。",
    ),
    "link.lost": ("The link to the board is lost.", "与主控板的连接已断开。"),
    "link.never": ("No frame came from the board yet.", "尚未收到主控板的数据帧。"),
    "bumper.restarted": ("The bridge has restarted.", "桥接服务已重启。"),
    "bumper.samples": ("Samples of the bumper were lost.", "防撞条的采样有丢失。"),
    "two_publishers.of": ("Two programs send as {sources}.", "两个程序都以 {sources} 的名称发送。"),
    "limit_stop.by": ("Stopped by {sources}.", "{sources} 要求停车。"),
    "limit_silent.of": ("No speed limit arrives from {sources}.", "收不到 {sources} 的限速消息。"),
    "limit.by": ("Slowed by {source:source}.", "被{source:source}限速。"),
    "neutral.overruled": (
        "{other:source} was in control: {source:source} must let go of the controls, then drive.",
        "{other:source}曾取得控制权：{source:source}须先松开操纵装置，再驾驶。",
    ),
    "blocked.near": (
        "No room toward the {sonar:word}: {distance:.2f} m.",
        "{sonar:word}方空间不足：{distance:.2f} m。",
    ),
    "blocked.untrusted": (
        "No motion toward the {sonar:word}: that sonar is {fault:word}.",
        "禁止向{sonar:word}方行驶：该超声波传感器状态为{fault:word}。",
    ),
    "blocked.creep_past": (
        "An operator can creep past: let go of the controls, then drive.",
        "操作员可以低速通过：请先松开操纵装置，再驾驶。",
    ),
    "obstacle.near": (
        "Slowed by an obstacle at {distance:.2f} m ({sonar:word}).",
        "因{sonar:word}方 {distance:.2f} m 处的障碍物减速。",
    ),
    "obstacle.untrusted": (
        "Creeping toward the {sonar:word}: that sonar is {fault:word} and sees nothing there.",
        "向{sonar:word}方低速行驶：该超声波传感器状态为{fault:word}，无法探测该方向。",
    ),
    "obstacle.suspect": (
        "Creeping toward the {sonar:word}: that sonar still shows {distance:.2f} m although the "
        "vehicle moved.",
        "向{sonar:word}方低速行驶：车辆已移动，但该超声波传感器仍显示 {distance:.2f} m。",
    ),
    "sonar.all": ("All sonars are {fault:word}.", "所有超声波传感器状态为{fault:word}。"),
    "sonar.one": (
        "Sonar not trusted: {sonar:word} ({fault:word}).",
        "超声波传感器不可信：{sonar:word}（{fault:word}）。",
    ),
    # control
    "control.of": ("{source:source} is in control.", "由{source:source}控制。"),
    "control.you": ("You are in control.", "由您控制。"),  # to the operator of that source
    "control.asked": (
        "{by} begins to drive while {other:source} is in control.",
        "{other:source}控制期间，{by} 开始驾驶。",
    ),
    "control.none": ("No operator and no program is in control.", "当前没有操作员或程序在控制车辆。"),
    # the next step at a latch
    "next.reset": ("Reset to go on.", "复位后方可行驶。"),
    "next.move_off": (
        "It is still pressed: move off first, then reset.", "防撞条仍被压下：请先脱离，再复位。",
    ),
    "next.reset_others": (
        "It is still pressed: reset first, then move off.", "防撞条仍被压下：请先复位，再脱离。",
    ),
    "next.by_hand": ("Push the vehicle off by hand, then reset.", "请用手推开车辆，再复位。"),
    "next.estop": (
        "It is still pressed or in effect: unlock it, then reset.",
        "急停仍被按下或仍然有效：请先解除，再复位。",
    ),
    "next.estop_keepalive": (
        "Start its program again, then reset.", "请重新启动其程序，再复位。",
    ),
    "next.fix": (
        "The cause is still present: fix it, then reset.", "原因仍然存在：请先排除，再复位。",
    ),
    "next.reset_first": ("Reset first.", "请先复位。"),
    # reset
    "reset.done": (
        "Reset. Let go of the controls, then drive.", "已复位。请先松开操纵装置，再驾驶。",
    ),
    "reset.partial": ("Reset, but these need another reset:", "已复位，但以下原因仍须复位："),
    "reset.still_present": ("Still present:", "仍然存在："),
    "reset.nothing": ("Nothing needs a reset.", "当前无需复位。"),
    "reset.no_cause": (
        "The reset names no cause. Send the `id` of each as `causes`. These need a reset:",
        "复位未指定原因：请将各原因的 `id` 作为 `causes` 发送。当前须复位：",
    ),
    "reset.other_cause": (
        "The reset names a cause that no longer needs one. These do:",
        "复位所指定的原因已无需复位。当前须复位：",
    ),
    "reset.motion": (
        "A command to drive is given: let go of the controls first.",
        "仍有行驶指令：请先松开操纵装置。",
    ),
    "reset.pending": (
        "Another reset is being decided: try again.", "正在处理另一次复位：请重试。",
    ),
    "standstill.unknown": (
        "Standstill is not confirmed: no velocity is received.", "车辆停止未得到确认：未收到速度。",
    ),
    "standstill.moving": ("The vehicle still moves.", "车辆仍在移动。"),
    # release
    "release.any_way": (
        "Hold F to move off forward, or B to move off backward.",
        "请按住 F（前进）或 B（后退）以脱离碰撞。",
    ),
    "release.one_way": (
        "Hold {key} to move off {direction:word}.", "请按住 {key}（{direction:word}）以脱离碰撞。",
    ),
    "release.into_contact": (
        "The vehicle drove {direction:word} into the contact: check that direction first.",
        "碰撞时车辆正在{direction:word}：请先查看该方向。",
    ),
    "release.no_contact": ("There is no contact to release.", "当前没有碰撞。"),
    "release.bumper_free": ("The bumper is free. Next: reset.", "防撞条已松开。下一步：复位。"),
    "release.no_operator": (
        "{source} may not release: only an operator who holds the controls may.",
        "{source} 不能执行脱离操作：仅限按住操纵装置的操作员。",
    ),
    "release.forbidden": (
        "Release {direction:word} is forbidden until a reset: the bumper was pressed that way.",
        "复位前禁止{direction:word}：该方向上防撞条再次被压下。",
    ),
    "release.let_go": (
        "A release begins with a new hold: let go first.", "脱离操作须重新按住：请先松开。",
    ),
    "release.unknown": (
        "Safety has restarted: the travel of an earlier release is unknown.",
        "安全服务已重启：此前的脱离距离未知。",
    ),
    "release.both_ways": (
        "The bumper was pressed in both directions.", "两个方向上防撞条均被压下。",
    ),
    "release.used_up": ("The distance for moving off is used up.", "脱离距离已用完。"),
    # calls
    "call.no_echo": (
        "The call carries no echo of safety's heartbeat: send the newest SafetyState.heartbeat as "
        "`echo`.",
        "该指令未携带安全服务的心跳编号：请将最新的 SafetyState.heartbeat 作为 `echo` 发送。",
    ),
    "call.unknown_echo": (
        "The call refers to an unknown state of safety: look again, then repeat it.",
        "该指令对应的安全服务状态未知：请查看画面后重试。",
    ),
    "call.late": (
        "The call is {age:.1f} s old, allowed is {limit:g} s: repeat it.",
        "该指令已过 {age:.1f} s，最多允许 {limit:g} s：请重试。",
    ),
    "call.no_answer": (
        "{service:service} does not answer; run {doctor}.",
        "{service:service}无应答：请运行 {doctor}。",
    ),
    "call.not_allowed": (
        "{service:service} does not answer: this certificate may not call it; see `t2 keys list`.",
        "{service:service}无应答：该证书无权调用；见 `t2 keys list`。",
    ),
    "call.not_connected": ("Not connected to the robot.", "未连接到机器人。"),
    "call.invalid": ("The message is invalid: {reason}.", "消息无效：{reason}。"),
    "board.absent": (
        "The board is absent (link {link:word}).", "主控板不在线（连接状态：{link:word}）。",
    ),
    "board.pending": (
        "Another call for the {what:word} is pending.", "{what:word}的另一次调用尚未完成。",
    ),
    "board.unconfirmed": (
        "The board did not confirm it within {timeout:g} s.", "主控板未在 {timeout:g} s 内确认。",
    ),
    "board.failure": ("The board reports a failure (0xAA).", "主控板报告失败（0xAA）。"),
    "board.lamp_set": ("The lamp is set.", "灯光已设置。"),
    # what the bridge waits for
    "waiting.estop": (
        "Safety has not acknowledged the emergency stop.", "安全服务尚未确认急停。",
    ),
    "waiting.hit": (
        "Safety has not acknowledged the bumper hit.", "安全服务尚未确认防撞条触发。",
    ),
    "waiting.uncommanded": (
        "The vehicle moved without a command: safety has not acknowledged that yet.",
        "车辆在无指令的情况下移动：安全服务尚未确认。",
    ),
    "waiting.latch_owner": (
        "Safety has not taken over the stop from before its restart.",
        "安全服务尚未接管重启前的停车状态。",
    ),
    "waiting.ready": ("The board is not ready.", "主控板尚未就绪。"),
    "waiting.neutral": (
        "Waiting for a command of zero speed from safety.", "正在等待安全服务的零速指令。",
    ),
    "waiting.board": (
        "Nothing received from the board yet on UDP port {ports}.",
        "UDP 端口 {ports} 尚未收到主控板的数据。",
    ),
    "waiting.link": ("The link to the board is lost.", "与主控板的连接已断开。"),
    "waiting.brakes": (
        "The board's emergency brakes are not both on and confirmed.",
        "主控板的两个紧急制动尚未全部开启并得到确认。",
    ),
    "waiting.no_confirmation": (
        "A firmware that confirms nothing needs {setting} = false.",
        "不作确认的固件需要设置 {setting} = false。",
    ),
    "relay.never": ("Nothing received from the relay yet.", "尚未收到中继器的数据。"),
    "relay.lost": ("The relay is silent.", "收不到中继器的数据。"),
    "relay.brakes": ("The relay brakes ({reason:word}).", "中继器正在制动（{reason:word}）。"),
    "camera.silent": (
        "Camera {camera}: no picture arrives from {source}.", "摄像头 {camera}：收不到 {source} 的图像。",
    ),
    "camera.ended": (
        "Camera {camera}: no picture. The stream has ended.", "摄像头 {camera}：没有图像。视频流已结束。",
    ),
    # the first part of the path that is missing
    "root.router": ("No connection to the robot.", "未连接到机器人。"),
    "root.safety": (
        "Safety does not run, or its state does not arrive.", "安全服务未运行，或收不到其状态。",
    ),
    "root.bridge": (
        "The bridge does not run, or it hangs: start it on the robot.",
        "桥接服务未运行或已停止响应：请在机器人上启动。",
    ),
    "root.relay": (
        "The relay is silent: check its power and cable.", "中继器无应答：请检查其电源和线缆。",
    ),
    "root.board": (
        "The board is silent: check its power and cable.", "主控板无应答：请检查其电源和线缆。",
    ),
    "root.may_move": (
        "The vehicle may still move: use its own switch.",
        "车辆可能仍在移动：请使用车身上的急停开关。",
    ),
    "pose.set": (
        "Pose set to x {x:.3f} m, y {y:.3f} m, {heading:.3f} rad.",
        "位姿已设置：x {x:.3f} m，y {y:.3f} m，{heading:.3f} rad。",
    ),
    # where the vehicle is in the map
    "map.placed": (
        "The position is known to {sigma:.2f} m and {degrees:.0f} degrees (standard deviations).",
        "位置已知，标准差为 {sigma:.2f} m 和 {degrees:.0f} 度。",
    ),
    "map.unplaced": (
        "The position is not known: place the vehicle (`t2 call localization/place`).",
        "位置未知：请设定车辆位置（`t2 call localization/place`）。",
    ),
    "map.restart": (
        "Odometry began anew, and the position is not known any more: place the vehicle "
        "(`t2 call localization/place`).",
        "里程计已重新开始，位置不再可知：请重新设定车辆位置（`t2 call localization/place`）。",
    ),
    "map.uncertain": (
        "The position is lost: it is known only to {sigma:.2f} m and {degrees:.0f} degrees. Place "
        "the vehicle (`t2 call localization/place`), or wait for fixes.",
        "位置已丢失：标准差达 {sigma:.2f} m 和 {degrees:.0f} 度。请设定车辆位置"
        "（`t2 call localization/place`），或等待定位修正。",
    ),
    "map.contradicted": (
        "The position is lost: {count} fixes of {source} in a row contradict it, and agree with "
        "each other. Find out which one is wrong, and place the vehicle "
        "(`t2 call localization/place`).",
        "位置已丢失：{source} 连续 {count} 次定位修正与其矛盾，且彼此一致。请查明何者有误，并设定车辆位置"
        "（`t2 call localization/place`）。",
    ),
    "fix.unknown_odometry": (
        "It names an odometry message that is older than 2 s, or of another start of odometry.",
        "所指的里程计消息早于 2 s，或属于里程计的另一次启动。",
    ),
    "fix.covariance": (
        "Its covariance is not positive definite.", "其协方差矩阵不是正定的。",
    ),
    "fix.repeated": (
        "It names no newer odometry message than the fix before.",
        "所指的里程计消息不比上一次定位修正新。",
    ),
    "fix.frozen": (
        "It repeats the last pose although the vehicle has moved.",
        "车辆已移动，但其位姿与上一次相同。",
    ),
    "fix.unplaced": (
        "The vehicle is not placed, and the settings do not let these fixes place it.",
        "车辆位置未设定，且设置不允许由这些定位修正设定位置。",
    ),
    "fix.no_heading": (
        "The vehicle is not placed, and a fix without a heading cannot place it.",
        "车辆位置未设定，无航向的定位修正无法设定位置。",
    ),
    "fix.placing": (
        "It places the vehicle once {count} fixes in a row agree.",
        "连续 {count} 次定位修正一致后，将据此设定车辆位置。",
    ),
    "fix.late": (
        "It was measured before the last placement, or too long ago.",
        "其测量早于上一次位置设定，或时间过久。",
    ),
    "fix.far": (
        "It is {sigmas:.1f} standard deviations from the pose.", "与当前位姿相差 {sigmas:.1f} 倍标准差。",
    ),
    "fix.refused": (
        "{count} fixes of {source} in a row were refused.", "{source} 连续 {count} 次定位修正被拒绝。",
    ),
    "place.done": (
        "The vehicle is placed at x {x:.2f} m, y {y:.2f} m, {degrees:.0f} degrees.",
        "车辆位置已设定：x {x:.2f} m，y {y:.2f} m，{degrees:.0f} 度。",
    ),
    "place.no_odometry": (
        "Odometry is silent: the vehicle cannot be placed.", "收不到里程计：无法设定车辆位置。",
    ),
    "place.moving": (
        "The vehicle moves: stop it, then place it.", "车辆正在移动：请先停车，再设定位置。",
    ),
    # commands of ROS nodes
    "cmd_vel.taken": ("Taken.", "已接受。"),
    "cmd_vel.unreadable": ("A command cannot be read: {reason}.", "无法读取指令：{reason}。"),
    "cmd_vel.other_type": (
        "Publish cmd_vel with the type of ros2.cmd_vel: a node publishes another one.",
        "请按 ros2.cmd_vel 设置的类型发布 cmd_vel：有节点以其他类型发布。",
    ),
    "cmd_vel.out_of_order": (
        "A command arrived again, or after a later one.", "指令重复到达，或晚于后一条指令到达。",
    ),
    "cmd_vel.held_back": (
        "Restart that node if this continues: a command came 0.2 s late, or its clock was set.",
        "若持续出现，请重启该节点：指令迟到 0.2 s 以上，或其时钟被调整。",
    ),
    "cmd_vel.settling": (
        "Keep publishing: commands are taken after 0.5 s.", "请继续发布：0.5 s 后接受指令。",
    ),
    "cmd_vel.second_publisher": (
        "Use one publisher at a time: another one drives.", "同一时间仅限一个发布者：另一个正在驾驶。",
    ),
    "cmd_vel.not_paused": (
        "Stop publishing for 0.5 s, then go on: motion was not allowed, or commands were lost.",
        "请停止发布 0.5 s 后继续：此前不允许行驶，或有指令丢失。",
    ),
    "cmd_vel.not_zero": (
        'Publish zero before motion: ros2.neutral is "zero".',
        '行驶前请先发布零速：ros2.neutral 为 "zero"。',
    ),
    "cmd_vel.not_finite": (
        "A command has a number that is not finite, or over 1e9.", "指令中有非有限的数值，或超过 1e9。",
    ),
    "cmd_vel.other_axes": (
        "Use linear.x and angular.z alone: this interface has no sideways motion.",
        "仅可使用 linear.x 和 angular.z：此接口不支持横向行驶。",
    ),
    # poses that ROS nodes measure
    "ros_fix.taken": ("Passed on to localization.", "已转交定位服务。"),
    "ros_fix.unreadable": ("A pose cannot be read: {reason}.", "无法读取位姿：{reason}。"),
    "ros_fix.clock": (
        "Synchronize the clocks, use_sim_time off: its stamp differs by {seconds:.2f} s from odometry.",
        "请同步时钟并关闭 use_sim_time：其时间戳与里程计相差 {seconds:.2f} s。",
    ),
    "ros_fix.no_odometry": (
        "Odometry is silent: a pose cannot be related to it.", "收不到里程计：无法使用位姿。",
    ),
    "ros_fix.frame": (
        "Use the frame '{map}': its frame is '{frame}'.", "请使用坐标系“{map}”：其坐标系为“{frame}”。",
    ),
    "ros_fix.orientation": (
        "Its quaternion is not of length 1, or it tilts the vehicle by over 0.3 rad.",
        "其四元数长度不为 1，或使车辆倾斜超过 0.3 rad。",
    ),
    "ros_fix.not_finite": (
        "A pose has a number that is not finite, or over 1e9.", "位姿中有非有限的数值，或超过 1e9。",
    ),
    # the terminal of ``t2 drive``
    "terminal.unknown": ("Terminal delay unknown: no answer yet.", "终端延迟未知：尚无应答。"),
    "terminal.slow": (
        "Terminal too slow: {delay:.2f} s, limit {limit:g} s.",
        "终端过慢：{delay:.2f} s，上限 {limit:g} s。",
    ),
    "terminal.ignored": ("Keystrokes ignored.", "按键已忽略。"),
    "terminal.advice": (
        "Use `t2 drive` on a machine near the robot, or the dashboard.",
        "请在靠近机器人的计算机上运行 `t2 drive`，或使用仪表板。",
    ),
    "gamepad.status": ("Gamepad:", "手柄："),
    "gamepad.off": ("off", "已关闭"),
    "gamepad.searching": ("searching", "正在查找"),
    "gamepad.none": ("none", "无"),
    "gamepad.device": ("{device}", "{device}"),
    "gamepad.several": ("{count} found: hold a deadman", "找到 {count} 个：请按住使能键"),
    "gamepad.unusable": (
        "none: {device} has no such axes or deadman", "无：{device} 没有所设的轴或使能键",
    ),
    "gamepad.no_library": ("none: pygame-ce is not installed", "无：未安装 pygame-ce"),
    "gamepad.failed": ("none: {reason}", "无：{reason}"),
    # operators
    "estop.by": ("Emergency stop by {who:operator}.", "{who:operator} 触发了急停。"),
    "operator.by": ("Certificate: {by}.", "证书：{by}。"),
    "driver.taken": (
        "{who:operator} has taken over control.", "{who:operator} 已接管控制权。",
    ),
    # events that a screen has not received
    "events.missing": ("{count} events are missing here.", "此处缺少 {count} 条事件。"),
}  # fmt: skip

LATCHED: Any = (  # names of both causes and events
    "contact", "estop", "estop_reader", "estop_keepalive", "predecessor", "runaway",
    "uncommanded_motion", "flapping",
)  # fmt: skip

# In the order of the document. A latched cause has an event of its name, with its texts.
EVENTS: tuple[EventRow, ...] = (
    EventRow(
        "bridge", "link_up", "info", ("The board is connected.", "主控板已连接。"),
        ("nothing to do; let go of the controls, then drive", "无需处理；松开操纵装置后可重新行驶"),
    ),
    EventRow(
        "bridge", "link_lost", "error",
        ("The board is silent: STOP is being sent.", "主控板无应答：正在发送停止指令。"),
        BOARD_LOST,
    ),
    EventRow(
        "bridge, safety", "drive_link_lost", "error",
        ("The drive link to {other:word} is lost.", "到{other:word}的驱动链路已断开。"),
        (
            "check that both run, on one host and as one user",
            "请检查两个服务是否以同一用户在同一主机上运行",
        ),
    ),
    EventRow(
        "bridge, safety", "drive_link_up", "info",
        ("The drive link to {other:word} is back.", "到{other:word}的驱动链路已恢复。"), NOTHING,
    ),
    EventRow(
        "bridge", "port_changed", "warning",
        (
            "Commands leave from UDP port {port} now: the velocity comes to it.",
            "指令现从 UDP 端口 {port} 发出：速度报告改由该端口到达。",
        ),
        ("nothing at once; if frequent, check the network load", "暂无需处理；若频繁出现，请检查网络负载"),
    ),
    EventRow(
        "bridge", "board_restarted", "warning",
        (
            "The board has restarted: its emergency brakes are set again.",
            "主控板已重启：正在重新设置紧急制动。",
        ),
        ("check its power supply, unless someone switched it off", "若非人为断电，请检查其电源"),
    ),
    EventRow(
        "bridge", "relay_up", "info", ("The relay passes commands.", "中继器正在转发指令。"),
        ("nothing to do; let go of the controls, then drive", "无需处理；松开操纵装置后可重新行驶"),
    ),
    EventRow(
        "bridge", "relay_braking", "warning",
        ("The relay brakes, with the reason.", "中继器正在制动，并给出原因。"),
        (
            "nothing at once: STOP ends it; if frequent, check the cable to the relay and the load of "
            "both computers",
            "暂无需处理：停止指令会将其解除；若频繁出现，请检查中继器线缆和两台计算机的负载",
        ),
    ),
    EventRow(
        "bridge", "relay_lost", "error",
        ("The relay is silent: the vehicle does not move.", "中继器无应答：车辆不会移动。"),
        ("check the relay's power and cable; `t2 doctor`", "请检查中继器的电源和线缆；`t2 doctor`"),
    ),
    EventRow(
        "bridge", "switches_unverified", "error",
        (
            "No motion: the board's emergency brakes are not both on and confirmed.",
            "禁止移动：主控板的两个紧急制动尚未全部开启并得到确认。",
        ),
        (
            f"`{CAUSES['switches'].remedy[0]}`; then check the board",
            f"`{CAUSES['switches'].remedy[1]}`；然后检查主控板",
        ),
    ),
    EventRow(
        "bridge", "contact", "error",
        ("The bumper is hit: BRAKE was sent.", "防撞条已触发：已发送制动指令。"),
        ("inspect the robot; see `contact` of safety", "请检查机器人；见安全服务的 `contact`"),
    ),
    EventRow(
        "bridge", "driver_fault", "error, info",
        (
            "The fault bits of a motor driver changed; info when all are cleared.",
            "电机驱动器的故障状态发生变化；全部清除时级别为 info。",
        ),
        (
            "fix the named fault: wheel blocked, battery, encoder cable",
            "请排除所示故障：车轮卡住、电池、编码器线缆",
        ),
    ),
    EventRow(
        "bridge", "second_authority", "error",
        (
            "Motions of another program than safety are refused.",
            "已拒绝安全服务以外的程序发送的运动指令。",
        ),
        (
            "`t2 doctor` counts the safety services, `t2 echo '@cmd/motion' --json` shows `boot` and "
            "`host` of each sender; stop the stranger, revoke its certificate",
            "`t2 doctor` 显示安全服务的数量，`t2 echo '@cmd/motion' --json` 显示各发送方的 `boot` 和 `host`；"
            "请停止未知程序并吊销其证书",
        ),
    ),
    EventRow(
        "bridge", "uncommanded_motion", "error",
        (
            "The vehicle moved from standstill while safety was absent: BRAKE.",
            "安全服务未运行时车辆从静止开始移动：已制动。",
        ),
        (
            "check for a slope or a push; start safety, which latches BRAKE for it; then reset",
            "请检查是否有坡度或被推动；启动安全服务（将锁定制动），然后复位",
        ),
    ),
    EventRow(
        "bridge", "guard_gone", "error",
        (
            "The guard has died: the bridge stops the vehicle and exits.",
            "守护进程已终止：桥接服务将停车并退出。",
        ),
        (
            "nothing to do: both are restarted; find out what killed it",
            "无需处理：两者会被重新启动；请查明终止原因",
        ),
    ),
    *(EventRow("safety", name, "error", *CAUSES[name]) for name in LATCHED),
    EventRow(
        "safety", "driver_fault", "error",
        ("A motor driver reports a fault.", "电机驱动器报告故障。"), DRIVER,
    ),
    EventRow(
        "safety", "stop", "info, warning",
        (
            "The vehicle has stopped, with the reason; info without a command to drive.",
            "车辆已停止，并给出原因；没有行驶指令时级别为 info。",
        ),
        ("as in the text", "按文中所述处理"),
    ),
    EventRow(
        "safety", "source", "info",
        ("Control has changed.", "控制权已切换。"), NOTHING,
    ),
    EventRow(
        "safety", "release", "warning",
        ("Creeping off the bumper.", "正在缓慢脱离碰撞。"),
        (
            "nothing to do: held by an operator, at most 0.15 m until a reset",
            "无需处理：由操作员按住控制，复位前最多 0.15 m",
        ),
    ),
    EventRow(
        "safety", "release_end", "warning",
        ("No longer creeping off the bumper.", "脱离碰撞操作已结束。"),
        ("reset when the bumper is free", "防撞条松开后复位"),
    ),
    EventRow(
        "safety", "release_free", "info",
        ("The bumper is free. Next: reset.", "防撞条已松开。下一步：复位。"), ("reset", "复位"),
    ),
    EventRow(
        "safety", "release_refused", "warning",
        (
            "A release was refused; the text gives the first reason, the state the newest one.",
            "脱离碰撞操作被拒绝；文中为首个原因，状态中为最新原因。",
        ),
        ("as in the text", "按文中所述处理"),
    ),
    EventRow(
        "safety", "reset", "info", ("The named causes are cleared.", "所指定的原因已清除。"),
        ("nothing to do; let go of the controls, then drive", "无需处理；松开操纵装置后可重新行驶"),
    ),
    EventRow(
        "safety", "reset_refused", "warning",
        ("A reset was refused, with the reason.", "复位被拒绝，并给出原因。"),
        ("as in the text", "按文中所述处理"),
    ),
    EventRow(
        "odom", "reanchored", "warning",
        ("The counters restarted: the pose is kept.", "计数已重新开始：位姿保持不变。"),
        ("nothing to do; if frequent, check the board's power", "无需处理；若频繁出现，请检查主控板电源"),
    ),
    EventRow(
        "odom", "pose_set", "info", ("An operator set the pose.", "操作员已设置位姿。"), NOTHING,
    ),
    EventRow(
        "odom", "silent", "warning",
        (
            "No velocities arrive: no odometry is published.",
            "未收到速度：不发布里程计。",
        ),
        ("see the bridge's `link_lost`", "见桥接服务的 `link_lost`"),
    ),
    EventRow(
        "odom", "velocity_back", "info", ("Velocities are received again.", "已恢复接收速度。"),
        NOTHING,
    ),
    EventRow(
        "odom", "slip", "warning",
        (
            "Counters and velocities disagree: wheels slip, or a unit is wrong.",
            "编码器计数与速度不一致：车轮打滑或单位有误。",
        ),
        (
            "check for wheel slip; at each turn: a wrong `wire.feedback_angular_unit`",
            "请检查车轮是否打滑；若每次转向时出现：`wire.feedback_angular_unit` 有误",
        ),
    ),
    EventRow(
        "odom", "slip_over", "info",
        ("Counters and velocities agree again.", "编码器计数与速度已恢复一致。"), NOTHING,
    ),
    EventRow(
        "localization", "placed", "info",
        ("The position in the map is known.", "地图中的位置已知。"), NOTHING,
    ),
    EventRow(
        "localization", "unplaced", "warning",
        ("The position in the map is not known.", "地图中的位置未知。"),
        ("place the vehicle: `t2 call localization/place`", "请设定车辆位置：`t2 call localization/place`"),
    ),
    EventRow(
        "localization", "lost", "warning",
        ("The position in the map is lost.", "地图中的位置已丢失。"),
        ("as in the text", "按文中所述处理"),
    ),
    EventRow(
        "localization", "fixes_refused", "warning",
        ("Several fixes in a row were refused.", "连续多次定位修正被拒绝。"),
        (
            "`t2 echo localization/pose --field sources` shows why",
            "`t2 echo localization/pose --field sources` 显示原因",
        ),
    ),
    EventRow(
        "localization", "fixes_back", "info",
        ("Fixes of {source} are used again.", "{source} 的定位修正已恢复使用。"), NOTHING,
    ),
    EventRow(
        "patrol", "round_start", "info", ("A round begins.", "巡逻开始。"), NOTHING,
    ),
    EventRow(
        "patrol", "station", "info", ("Arrived at a station.", "已到达站点。"), NOTHING,
    ),
    EventRow(
        "patrol", "round_waiting", "info",
        ("A round waits: the way is not free.", "巡逻等待中：通道受阻。"),
        ("nothing to do: it goes on by itself", "无需处理：自动继续"),
    ),
    EventRow(
        "patrol", "round_blocked", "warning",
        ("A round is blocked for longer than its patience.", "巡逻受阻超过等待时限。"),
        ("free the way, or `t2 rounds return`", "请清空通道，或运行 `t2 rounds return`"),
    ),
    EventRow(
        "patrol", "round_paused", "info",
        ("A round is paused, by an operator or another program.", "巡逻已暂停：由操作员或其他程序引起。"),
        ("`t2 rounds resume` goes on", "`t2 rounds resume` 可继续"),
    ),
    EventRow(
        "patrol", "round_stopped", "warning",
        ("A round has stopped, with the reason.", "巡逻已停止，并给出原因。"),
        ("as in the text; then `t2 rounds resume`", "按文中所述处理；然后运行 `t2 rounds resume`"),
    ),
    EventRow(
        "patrol", "round_resumed", "info", ("A round goes on.", "巡逻继续。"), NOTHING,
    ),
    EventRow(
        "patrol", "round_return", "info", ("A round turns back home.", "巡逻返回起点。"), NOTHING,
    ),
    EventRow(
        "patrol", "round_end", "info, warning",
        ("A round is over; warning when it was aborted.", "巡逻结束；中止时级别为 warning。"),
        ("after an abort, drive the vehicle home", "中止后，请将车辆驾驶回起点"),
    ),
    EventRow(
        "patrol", "round_skipped", "warning",
        ("A scheduled round is skipped, with the reason.", "跳过定时巡逻，并给出原因。"),
        ("as in the text", "按文中所述处理"),
    ),
    EventRow(
        "patrol", "round_unwritten", "error",
        ("The ledger cannot be written.", "无法写入台账。"),
        ("free disk space; it is tried again", "请释放磁盘空间；会自动重试"),
    ),
    EventRow(
        "patrol", "teaching", "info, warning",
        (
            "Teaching begins, ends, or records nothing more, with the reason.",
            "示教开始、结束或不再记录，并给出原因。",
        ),
        ("as in the text", "按文中所述处理"),
    ),
    EventRow(
        "patrol", "route_changed", "info",
        ("A route is saved or deleted.", "路线已保存或删除。"), NOTHING,
    ),
    EventRow(
        "teleop", "gamepad", "info", ("Gamepad: {device}.", "手柄：{device}。"),
        (
            "nothing to do; a disconnected one counts as let go",
            "无需处理；断开的手柄视为已松开",
        ),
    ),
    EventRow(
        "teleop", "unheard", "warning",
        (
            "No state of safety for {seconds:g} s: the controls count as let go.",
            "{seconds:g} s 未收到安全服务状态：操纵装置视为已松开。",
        ),
        ("check Wi-Fi, router, safety: `t2 doctor`", "请检查 Wi-Fi、路由器、安全服务：`t2 doctor`"),
    ),
    EventRow(
        "teleop, dashboard, estop", "estop", "warning",
        ("Emergency stop by {by:operator}.", "{by:operator} 触发了急停。"),
        ("see `estop` of safety", "见安全服务的 `estop`"),
    ),
    EventRow(
        "teleop, dashboard", "reset_request", "info",
        ("Reset pressed by {by:operator}.", "{by:operator} 按下了复位。"), NOTHING,
    ),
    EventRow(
        "dashboard", "round_request", "info",
        (
            "Patrol, by {by:operator}: {action:word}.",
            "{by:operator} 操作巡逻：{action:word}。",
        ),
        NOTHING,
    ),
    EventRow(
        "teleop, dashboard", "take_over", "info",
        (
            "{by:operator} takes control from {other:operator}.",
            "{by:operator} 从 {other:operator} 接管控制权。",
        ),
        NOTHING,
    ),
    EventRow(
        "dashboard", "take", "info",
        ("{by:operator} takes control.", "{by:operator} 取得控制权。"), NOTHING,
    ),
    EventRow(
        "dashboard", "leave", "info",
        ("{by:operator} no longer has control.", "{by:operator} 不再拥有控制权。"), NOTHING,
    ),
    EventRow(
        "teleop", "overruled", "warning",
        (
            "{other:source} has taken over: the controls count as let go.",
            "{other:source}取得控制权：操纵装置视为已松开。",
        ),
        (
            "let go of the keyboard and the gamepad, then drive again",
            "请松开键盘和手柄，然后重新驾驶",
        ),
    ),
    EventRow(
        "teleop", "estop_denied", "error",
        (
            "EMERGENCY STOP NOT CONFIRMED, probably not allowed: use the vehicle's own switch.",
            "急停未被确认，可能无权急停：请使用车身上的急停开关。",
        ),
        (f"{OWN_SWITCH[0]}, `t2 keys list`", f"{OWN_SWITCH[1]}、`t2 keys list`"),
    ),
    EventRow(
        "teleop", "estop_unconfirmed", "error",
        (
            "EMERGENCY STOP NOT CONFIRMED: use the vehicle's own switch.",
            "急停未被确认：请使用车身上的急停开关。",
        ),
        OWN_SWITCH,
    ),
    EventRow(
        "teleop", "reset_unconfirmed", "error",
        (
            "RESET NOT CONFIRMED: safety's state does not show the effect of the reset.",
            "复位未被确认：安全服务的状态没有变化。",
        ),
        (
            "look at the vehicle; `t2 ls --services`: does another program answer for safety?",
            "请查看车辆；`t2 ls --services`：是否有其他程序代替安全服务应答？",
        ),
    ),
    EventRow(
        "teleop", "terminal_slow", "warning",
        (
            "The terminal is too slow: its keystrokes do not drive.",
            "终端响应过慢：其按键不能驾驶。",
        ),
        (
            "run `t2 drive` on a machine near the robot, or use the dashboard",
            "请在靠近机器人的计算机上运行 `t2 drive`，或使用仪表板",
        ),
    ),
    EventRow(
        "teleop", "gamepad_silent", "warning",
        (
            "Gamepad deflected, and its reading is unchanged for {seconds:g} s: it counts as let go.",
            "手柄偏转且读数 {seconds:g} s 无变化：视为已松开。",
        ),
        (
            "let go of the deadman, then press it again; if frequent, check battery or range",
            "请松开使能键后重新按住；若频繁出现，请检查电池或距离",
        ),
    ),
    EventRow(
        "teleop", "barred", "error",
        (
            "NOT ALLOWED: this certificate may not drive; it may only watch.",
            "未获许可：此证书无权驾驶，只能观看。",
        ),
        (
            "use a driver's certificate for this robot; `t2 doctor`",
            "请使用本机器人的驾驶员证书；`t2 doctor`",
        ),
    ),
    EventRow(
        "camera", "camera_up", "info",
        (
            "Camera {camera}: pictures arrive, {width} x {height}.",
            "摄像头 {camera}：图像正常，{width} x {height}。",
        ),
        NOTHING,
    ),
    EventRow(
        "camera", "camera_frozen", "warning",
        (
            "Camera {camera}: the picture does not change while the vehicle moves.",
            "摄像头 {camera}：车辆移动时图像没有变化。",
        ),
        (
            "restart the camera; from a distance driving is not possible until the picture changes",
            "请重启摄像头；图像恢复变化之前不能远程驾驶",
        ),
    ),
    EventRow(
        "camera", "camera_lost", "warning",
        (
            "Camera {camera}: no picture. {reason}",
            "摄像头 {camera}：没有图像。{reason}",
        ),
        (
            "check the camera's power, its cable and `camera.source`",
            "请检查摄像头的电源、线缆和 `camera.source`",
        ),
    ),
    EventRow(
        "dashboard", "in_sight", "warning",
        (
            "{by:operator} sees the vehicle and drives without the picture.",
            "{by:operator} 目视车辆，不依靠图像驾驶。",
        ),
        NOTHING,
    ),
    EventRow(
        "dashboard", "by_picture", "info",
        (
            "{by:operator} drives by the picture.",
            "{by:operator} 依靠图像驾驶。",
        ),
        NOTHING,
    ),
    EventRow(
        "recorder", "black_box", "info",
        ("The black box is written to {file}", "黑匣子记录已写入 {file}"),
        ("`t2 report FILE`", "`t2 report FILE`"),
    ),
    EventRow(
        "recorder", "black_box_lost", "error",
        (
            "The black box is not written ({causes:word}): {problem}.",
            "黑匣子记录未写入（{causes:word}）：{problem}。",
        ),
        ("free disk space", "请释放磁盘空间"),
    ),
    EventRow(
        "recorder", "disk_full", "error",
        ("No room for recordings: {problem}.", "没有空间保存记录：{problem}。"),
        ("free disk space; recording continues by itself", "请释放磁盘空间；记录会自动继续"),
    ),
    EventRow(
        "recorder", "disk_room", "info",
        (
            "The disk has room again: recording continues.",
            "磁盘空间已恢复：继续记录。",
        ),
        NOTHING,
    ),
    EventRow(
        "recorder", "recordings_removed", "warning",
        (
            "{count} of the oldest recordings removed to free {megabytes:.0f} MB.",
            "已删除最旧的 {count} 个记录，释放 {megabytes:.0f} MB。",
        ),
        ("copy recordings that you want to keep", "请备份需要保留的记录"),
    ),
    EventRow(
        "recorder", "log_dropped", "warning",
        (
            "{count} events are not in the shift log: too many in a minute.",
            "有 {count} 个事件未记入值班日志：一分钟内过多。",
        ),
        ("`t2 echo 'evt/*'` shows who publishes them", "`t2 echo 'evt/*'` 显示其发布者"),
    ),
    EventRow(
        "ros2", "cmd_vel_refused", "warning",
        (
            "A velocity command of a ROS node is refused, with the reason.",
            "ROS 节点的速度指令被拒绝，并给出原因。",
        ),
        ("as in the text ([ros2.md](ros2.md))", "按文中所述处理（ros2.md）"),
    ),
    EventRow(
        "ros2", "ros_fix_refused", "warning",
        (
            "A pose that a ROS node has measured is refused, with the reason.",
            "ROS 节点测得的位姿被拒绝，并给出原因。",
        ),
        ("as in the text ([ros2.md](ros2.md#poses-in-the-map))", "按文中所述处理（ros2.md）"),
    ),
)  # fmt: skip

# Services by their names on the bus.
SERVICES: dict[str, Words] = {
    "bridge": ("bridge", "桥接服务"),
    "safety": ("safety", "安全服务"),
    "odom": ("odometry", "里程计"),
    "localization": ("localization", "定位服务"),
    "patrol": ("patrol", "巡逻服务"),
    "camera": ("camera", "摄像头"),
    "teleop": ("teleop", "驾驶终端"),
    "dashboard": ("dashboard", "仪表板"),
    "estop": ("emergency stop", "急停"),
    "recorder": ("recorder", "记录器"),
    "metrics": ("metrics", "监控指标"),
    "ros2": ("ROS 2", "ROS 2"),
}

# Sources of requests in the default settings, as an operator knows them.
SOURCES: dict[str, Words] = {
    "web": ("web (page)", "网页（web）"),
    "teleop": ("teleop (terminal)", "驾驶终端（teleop）"),
    "patrol": ("patrol", "巡逻（patrol）"),
    "checkout": ("checkout", "验收程序（checkout）"),
}

# Words inside a phrase, such as names of inputs. A word without a row is shown as it is, with spaces.
WORDS: dict[str, Words] = {
    "on": ("on", "开"),
    "off": ("off", "关"),
    "unknown": ("unknown", "未知"),
    "forward": ("forward", "前进"),
    "backward": ("backward", "后退"),
    "left": ("left", "左"),
    "right": ("right", "右"),
    "front": ("front", "前"),
    "rear": ("rear", "后"),
    "front_left": ("front left", "左前"),
    "front_right": ("front right", "右前"),
    "rear_left": ("rear left", "左后"),
    "rear_right": ("rear right", "右后"),
    "velocity": ("velocity", "速度"),
    "ultrasonic": ("ultrasonic", "超声波"),
    "bumper": ("bumper", "防撞条"),
    "driver_left": ("left driver", "左驱动器"),
    "driver_right": ("right driver", "右驱动器"),
    "link": ("link", "主控板连接"),
    "switches": ("switches", "紧急制动开关"),
    "lamps": ("lamps", "灯光"),
    "estop": ("emergency stop", "急停"),
    "estop_path": ("the path of the emergency stop", "急停通路"),
    "never": ("never up", "从未连接"),
    "lost": ("lost", "已断开"),
    "relay_start": ("it waits for a command of zero speed", "等待零速指令"),
    "relay_silent": ("it has lost the commands of the PC", "收不到工控机的指令"),
    "relay_hit": ("it waits for the answer to a bumper hit", "等待对防撞条触发的应答"),
    "silent": ("silent", "无数据"),
    "faulty": ("faulty", "故障"),
    "too_near": ("too near to measure", "过近，无法测量"),
    "suspect": ("suspect", "可疑"),
    "over_current": ("over current", "过流"),
    "over_voltage": ("over voltage", "过压"),
    "encoder": ("encoder", "编码器"),
    "under_voltage": ("under voltage", "欠压"),
    "overload": ("overload", "过载"),
    "viewer": ("viewer", "观看者"),
    "contact": ("contact", "防撞条触发"),
    "estop_reader": ("emergency stop not received", "急停信号接收中断"),
    "estop_keepalive": ("emergency stop keepalive", "急停维持信号中断"),
    "predecessor": ("restart of safety", "安全服务重启"),
    "uncommanded_motion": ("uncommanded motion", "无指令移动"),
    "flapping": ("repeated input failures", "输入反复失效"),
    "runaway": ("runaway", "未按指令运动"),
    **SERVICES,
    **patrol_texts.STATES,
    **patrol_texts.ACTIONS,
}  # fmt: skip

TEXTS: dict[str, Words] = {
    **PHRASES,
    **patrol_texts.PHRASES,
    **log_texts.PHRASES,
    **{name: entry.text for name, entry in CAUSES.items()},
    # An event of a cause that latches has the phrases of the cause.
    **{
        f"event.{row.name}": row.text
        for row in EVENTS
        if row.services != "safety" or row.name not in LATCHED
    },
}
