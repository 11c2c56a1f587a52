"""Texts of the terminal in English and Chinese, beside those of the catalogue: labels, alarms.

A name has the form ``PANEL.WHAT``. Texts that go over the bus are in ``t2.catalogue``.
"""

from collections.abc import Iterable

from t2 import catalogue
from t2.messages import Field, Phrase
from t2.patrol_texts import Words
from t2.words import Language, in_language, render

LABELS: dict[str, Words] = {
    "title.safety": ("safety", "安全"),
    "title.around": ("around", "四周"),
    "title.motion": ("motion", "运动"),
    "title.events": ("events", "事件"),
    "no_data": ("no data", "无数据"),
    # header
    "bus.up": ("● connected", "● 已连接"),
    "bus.no_router": ("○ not connected", "○ 未连接"),
    "bridge.missing": ("○ bridge missing", "○ 桥接服务未运行"),
    "bridge.no_data": ("○ no data of the bridge", "○ 桥接服务无数据"),
    "board.up": ("● board", "● 主控板"),
    "board.lost": ("○ board lost", "○ 主控板失联"),
    "board.never": ("○ board never seen", "○ 主控板从未连接"),
    "bumper.unknown": ("○ bumper", "○ 防撞条"),
    "bumper.free": ("● bumper", "● 防撞条"),
    "bumper.pressed": ("● bumper PRESSED", "● 防撞条被压下"),
    "gear": ("gear {gear}/5", "{gear}/5 挡"),
    "top": ("{linear:.2f} m/s {angular:.2f} rad/s", "{linear:.2f} m/s {angular:.2f} rad/s"),
    # safety
    "verdict.run": ("RUN", "运行"),
    "verdict.slow": ("SLOW", "减速"),
    "verdict.stop": ("STOP", "停止"),
    "verdict.brake": ("BRAKE", "制动"),
    "verdict.inhibited": ("NOT READY", "禁止行驶"),
    "verdict.no_safety": ("NO SAFETY", "安全服务无应答"),
    "verdict.no_router": ("NO CONNECTION TO THE ROBOT", "未连接到机器人"),
    "text.no_safety": (
        "It may drive by itself: this terminal does not know. Look at it, then call a technician.",
        "机器人可能正在自行行驶，本终端无法得知。请查看机器人，然后联系技术人员。",
    ),
    "text.no_router": (
        "It is told to stop within a second, unless another program drives it. Is it on, and its "
        "network? Then call a technician.",
        "除非其他程序在驾驶，机器人会在一秒内收到停车指令。请确认机器人已开机且网络正常，然后联系技术人员。",
    ),
    "text.own_switch": (
        "To stop the vehicle, use its own switch.", "停车请使用车身上的急停开关。",
    ),
    "technician.no_safety": (
        "For the technician: no state of safety arrives through {router}. Next: {doctor}",
        "供技术人员参考：经 {router} 收不到安全服务的状态。下一步：{doctor}",
    ),
    "technician.no_router": (
        "For the technician: no answer at {router}. Next: {doctor}",
        "供技术人员参考：{router} 无应答。下一步：{doctor}",
    ),
    "text.next": ("Next: {doctor}", "下一步：{doctor}"),
    "off.believed": ("RELEASE  believed free: ", "脱离碰撞  推断可脱离："),
    "off.came": (
        " (moved {came:word}; net {travelled:+.2f} m)", "（最近{came:word}，净 {travelled:+.2f} m）",
    ),
    "off.came_ago": (
        " (moved {came:word}, {age} ago; net {travelled:+.2f} m)",
        "（{age}前{came:word}，净 {travelled:+.2f} m）",
    ),
    "off.unknown": ("RELEASE  free direction ", "脱离碰撞  可脱离方向"),
    "off.look": ("unknown: look at the vehicle", "未知：请目视确认"),
    "off.forbidden": ("FORBIDDEN", "禁止"),
    "off.held": (", held", "，已按住"),
    "off.left": ("{left:.2f} m left until reset", "复位前剩余 {left:.2f} m"),
    "off.way": ("{direction:word}", "{direction:word}"),
    "cause.latched": ("RESET NEEDED", "须复位"),
    "action.slow": ("slow", "减速"),
    "action.stop": ("stop", "停止"),
    "action.brake": ("brake", "制动"),
    "age.seconds": ("{seconds:.0f} s", "{seconds:.0f} 秒"),
    "age.minutes": ("{minutes:.0f} min", "{minutes:.0f} 分钟"),
    # causes by name, where there is no room for their texts
    "cause.contact": ("contact", "碰撞"),
    "cause.estop": ("E-STOP", "急停"),
    "cause.estop_reader": ("E-STOP not received", "急停接收中断"),
    "cause.estop_keepalive": ("E-STOP signal lost", "急停维持信号中断"),
    "cause.predecessor": ("not reset before restart", "重启前未复位"),
    "cause.runaway": ("moved otherwise", "未按指令运动"),
    "cause.uncommanded_motion": ("moved by itself", "无指令移动"),
    "cause.not_stopping": ("standstill not confirmed", "停止未确认"),
    "cause.driver_left": ("left motor fault", "左电机故障"),
    "cause.driver_right": ("right motor fault", "右电机故障"),
    "cause.flapping": ("repeated failures", "输入反复失效"),
    "cause.leaving": ("safety ends", "安全服务关闭"),
    "cause.starting": ("waiting for data", "等待首批数据"),
    "cause.link": ("board lost", "主控板断开"),
    "cause.switches": ("brakes not verified", "紧急制动未确认"),
    "cause.bumper": ("no bumper data", "防撞条无数据"),
    "cause.silent": ("old data", "数据过旧"),
    "cause.unarmed": ("bridge not ready", "桥接服务未就绪"),
    "cause.limit_stop": ("stopped by a limit", "限速程序停车"),
    "cause.limit_silent": ("limit silent", "限速程序无消息"),
    "cause.two_publishers": ("two programs", "程序重复"),
    "cause.neutral": ("let go first", "请先松开"),
    "cause.blocked": ("blocked", "空间不足"),
    "cause.no_request": ("no command", "无行驶指令"),
    "cause.release": ("release", "脱离碰撞"),
    "cause.limit": ("limit", "限速"),
    "cause.obstacle": ("obstacle", "障碍物"),
    "cause.sonar": ("sonar not trusted", "超声波不可信"),
    # sonars
    "around.bumper": ("BUMPER", "防撞条"),
    "sonar.fault": ("fault", "故障"),
    "sonar.too_near": ("near", "过近"),
    "sonar.no_echo": ("-", "-"),
    # motion
    "motion.request": ("target", "目标"),
    "motion.allowed": ("allowed", "允许"),
    "motion.measured": ("measured", "实测"),
    "motion.pose": ("pose", "位姿"),
    "motion.map": ("map", "地图"),
    "motion.odom": ("odom", "里程计"),
    "motion.board": ("board", "主控板"),
    "motion.motor_left": ("motor L", "左电机"),
    "motion.motor_right": ("motor R", "右电机"),
    "motion.driver": ("driver", "驾驶"),
    "motion.gamepad": ("gamepad", "手柄"),
    "lost": ("LOST", "已丢失"),
    "odom.residual": ("residual {residual:+.3f} m  ", "残差 {residual:+.3f} m  "),
    "odom.no_residual": ("residual -  ", "残差 -  "),
    "odom.slip": ("SLIP", "打滑"),
    "odom.no_slip": ("no slip", "无打滑"),
    "to_board.lost": ("lost: {board}", "失联：{board}"),
    "to_board.never": ("never: {board}", "从未连接：{board}"),
    "to_board.not_armed": ("not armed", "未就绪"),
    "motor.ok": ("ok", "正常"),
    "motor.faults": ("{faults:word}", "{faults:word}"),
    "driver.release": ("you, release {direction:word}", "您，脱离碰撞（{direction:word}）"),
    "driver.you": ("{source} (you)", "{source}（您）"),
    "driver.none": ("none", "无"),
    "gamepad.due": ("no change: MOVE THE STICK", "读数无变化：请晃动摇杆"),
    "gamepad.frozen": ("FROZEN: let go of the deadman", "手柄无响应：请松开使能键"),
    "gamepad.ignored": ("OFF CENTRE, ignored: axis {axes}", "未居中，已忽略：轴 {axes}"),
    # what the bridge waits for, where there is no room for its text
    "short.waiting.estop": ("safety must confirm the E-STOP", "等待安全服务确认急停"),
    "short.waiting.hit": ("safety must confirm the hit", "等待安全服务确认碰撞"),
    "short.waiting.uncommanded": ("safety must confirm the motion", "等待安全服务确认移动"),
    "short.waiting.latch_owner": ("safety must take over the stop", "等待安全服务接管停车状态"),
    "short.waiting.ready": ("the board is not ready", "主控板尚未就绪"),
    "short.waiting.neutral": ("waits for zero speed", "等待零速指令"),
    "short.waiting.board": ("nothing received yet", "尚未收到数据"),
    "short.waiting.link": ("the link is lost", "连接已断开"),
    "short.waiting.brakes": ("emergency brakes not confirmed", "紧急制动尚未确认"),
    "short.relay.never": ("no report of the relay yet", "尚未收到中继器数据"),
    "short.relay.lost": ("the relay is silent", "收不到中继器数据"),
    "short.relay.brakes": ("the relay brakes", "中继器正在制动"),
    # keystrokes
    "hint.drive": ("drive", "行驶"),
    "hint.stop": ("stop", "停车"),
    "hint.gear": ("gear", "挡位"),
    "hint.estop": ("ESTOP", "急停"),
    "hint.reset": ("reset", "复位"),
    "hint.release": ("release", "脱离"),
    "hint.arcs": ("arcs", "弧线"),
    "hint.quit": ("quit", "退出"),
    "keyboard.off": ("KEYBOARD OFF: {why}", "键盘无效：{why}"),
    "keyboard.muted": (
        "KEYBOARD OFF: let go of it for {seconds:g} s", "键盘无效：请全部松开 {seconds:g} 秒",
    ),
    "keyboard.holds": (
        "No key-up in terminals: a tap drives {first:g} s, a hold {repeat:g} s past its last repeat",
        "终端不报告松开：点按行驶 {first:g} 秒，按住则在末次重复后行驶 {repeat:g} 秒",
    ),
    "keystroke.no_function": ("{keystroke} has no function here.", "按键 {keystroke} 无效。"),
    "keystroke.layout": (
        "SWITCH THE KEYBOARD TO LATIN (ENGLISH).", "请将键盘切换为英文（拉丁字母）输入。",
    ),
    "keystroke.late": (
        "{keystroke} ignored: it is older than {limit:g} s.", "已忽略按键 {keystroke}：超过 {limit:g} s。",
    ),
    # alarms
    "estop.not_sent_yet": (
        "EMERGENCY STOP NOT SENT YET: no connection. Use the vehicle's own switch. It is sent if the "
        "connection returns within {seconds:.0f} s.",
        "急停尚未发送：没有连接。请使用车身上的急停开关。若在 {seconds:.0f} 秒内恢复连接，将自动发送。",
    ),
    "estop.repeated": (
        "It is repeated for {seconds:.0f} s.", "将继续发送 {seconds:.0f} 秒。",
    ),
    "estop.was_not_sent": (
        "YOUR E-STOP WAS NOT SENT: press E again; use the vehicle's own switch.",
        "您的急停未发送：请再按一次 E；请使用车身上的急停开关。",
    ),
    "estop.was_not_confirmed": (
        "YOUR E-STOP IS NOT CONFIRMED: press E again; use the vehicle's own switch.",
        "您的急停未被确认：请再按一次 E；请使用车身上的急停开关。",
    ),
    "estop.acknowledge": ("Enter: understood", "按 Enter 键清除提示"),
    "view_only.no_stop": (
        "VIEW ONLY, and no emergency stop: use the vehicle's own switch.",
        "仅限观看，不能急停：请使用车身上的急停开关。",
    ),
    "view_only": (
        "VIEW ONLY: this certificate may not drive, and perhaps not stop.",
        "仅限观看：此证书无权驾驶，可能也无权急停。",
    ),
    "overruled": (
        "OVERRULED by {by:source}: let go of the controls.",
        "{by:source}已取得控制权：请松开操纵装置。",
    ),
    # lines of this terminal's own events panel
    "reset.not_sent": (
        "Reset not sent: no fresh state of safety.", "复位未发送：没有安全服务的最新状态。",
    ),
    "gamepad.off_centre": (
        "Gamepad: axis {axis} is at {position:.2f} as the deadman goes down: ignored. Center it and "
        "press again, or correct teleop.*_axis or teleop.deadzone.",
        "手柄：按下使能键时轴 {axis} 位于 {position:.2f}：已忽略。请居中后重新按下，或修改 teleop.*_axis、"
        "teleop.deadzone。",
    ),
}  # fmt: skip
TEXTS = {**catalogue.TEXTS, **LABELS}


class Labels:
    """The texts in one language."""

    def __init__(self, language: Language = "en") -> None:
        self._language = language

    def __call__(self, name: str, **fields: Field) -> str:
        """Return a text by its name; raise ``KeyError`` without it."""
        if name not in TEXTS:
            raise KeyError(name)
        return self.render((Phrase(name, fields),))

    def known(self, name: str, otherwise: str, **fields: Field) -> str:
        """Return a text by its name, otherwise this one."""
        return self.render((Phrase(name, fields),), otherwise)

    def render(self, phrases: Iterable[Phrase], otherwise: str = "") -> str:
        """Return phrases as a text, otherwise the text of their message."""
        return render(phrases, self._language, otherwise, TEXTS)

    def service(self, name: str) -> str:
        """Return the name of a service for people."""
        return in_language(catalogue.SERVICES.get(name, (name, name)), self._language)

    def short(self, phrases: Iterable[Phrase], otherwise: str = "") -> str:
        """Return a shorter text of the first phrase if there is one."""
        name = next((f"short.{phrase.name}" for phrase in phrases), "")
        return self(name) if name in LABELS else self.render(phrases, otherwise)
