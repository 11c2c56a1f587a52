"""Catalogue of all texts on the page, in English and in Chinese; a test checks that it is complete.

Services publish their texts (a cause with its figures, an event, a refusal) in English. In Chinese
the page shows the entry of the cause's or event's name, and the service's text below it.
"""

from services.dashboard.i18n_events import EVENTS

PAGE: dict[str, tuple[str, str]] = {
    # --- header -------------------------------------------------------------------------------
    "estop": ("E-STOP", "急停"),
    "robot": ("Robot", "机器人"),
    "language": ("中文", "English"),
    "theme": ("Light or dark", "浅色或深色"),
    "your_name": ("Your name", "您的名字"),
    "viewer": ("Viewer", "观看者"),
    "nobody_drives": ("No driver", "无人驾驶"),
    "you_drive": ("You drive", "您在驾驶"),
    "drives": ("drives", "正在驾驶"),
    "watching": ("watching", "人在观看"),
    # --- state --------------------------------------------------------------------------------
    "verdict.run": ("RUN", "运行"),
    "verdict.slow": ("SLOW", "减速"),
    "verdict.stop": ("STOP", "停止"),
    "verdict.brake": ("BRAKE", "制动"),
    "verdict.inhibited": ("INHIBITED", "禁止"),
    "verdict.none": ("NO SAFETY", "安全服务无响应"),
    "verdict.lost": ("NO CONNECTION", "连接中断"),
    "text.none": (
        "No state of safety is received. The state of the vehicle is unknown.",
        "未收到安全服务的状态，车辆状态未知。",
    ),
    "text.lost": (
        "The dashboard does not respond. To stop the vehicle, use its own switch.",
        "仪表板无响应。如需停车，请使用车身上的急停开关。",
    ),
    "text.no_router": ("The dashboard is not connected to a router.", "仪表板未连接到路由器。"),
    "text.run": ("Driving as requested.", "按请求行驶。"),
    "reset_due": ("Reset before driving.", "复位后方可行驶。"),
    "take_to_reset": ("Take control to reset.", "请先取得控制权，再复位。"),
    "since": ("for", "已持续"),
    "latched": ("latched", "已锁定"),
    "speed": ("m/s", "米/秒"),
    "turn": ("rad/s", "弧度/秒"),
    "link.up": ("Board: up", "主板：在线"),
    "link.lost": ("Board: LOST", "主板：失联"),
    "link.never": ("Board: never seen", "主板：从未连接"),
    "link.none": ("Bridge: no data", "桥接服务：无数据"),
    "bumper.true": ("BUMPER PRESSED", "防撞条被压下"),
    "bumper.false": ("Bumper: clear", "防撞条：正常"),
    "bumper.none": ("Bumper: unknown", "防撞条：未知"),
    # --- causes, by the names of safety's table -------------------------------------------------
    "cause.contact": ("The bumper was hit.", "防撞条被碰撞。"),
    "cause.estop": ("Emergency stop.", "急停。"),
    "cause.estop_reader": ("The emergency stop cannot be received.", "无法接收急停信号。"),
    "cause.predecessor": (
        "Safety restarted while a reset was due.", "安全服务已重启，仍需复位。"),
    "cause.runaway": ("The vehicle did not move as commanded.", "车辆未按指令运动。"),
    "cause.uncommanded_motion": (
        "The vehicle moved while standstill was commanded.", "停止指令期间车辆发生移动。"),
    "cause.not_stopping": ("The vehicle does not stop.", "车辆未能停住。"),
    "cause.bumper_lossy": (
        "Creeping: bumper polls were lost.", "防撞条查询有丢失，只能低速行驶。"),
    "cause.driver_left": ("The left motor driver reported a fault.", "左侧电机驱动器报告故障。"),
    "cause.driver_right": ("The right motor driver reported a fault.", "右侧电机驱动器报告故障。"),
    "cause.flapping": ("Inputs failed repeatedly.", "输入信号反复失效。"),
    "cause.leaving": ("The safety service is shutting down.", "安全服务正在关闭。"),
    "cause.starting": ("Waiting for the first samples.", "正在等待首批数据。"),
    "cause.link": ("The link to the board is down.", "与主板的连接已断开。"),
    "cause.switches": (
        "The board's emergency brakes are not verified.", "主板的紧急制动尚未确认。"),
    "cause.bumper": ("The bumper is not being read.", "读不到防撞条。"),
    "cause.silent": ("An input is too old.", "输入数据过旧。"),
    "cause.unarmed": ("The bridge is not armed yet.", "桥接服务尚未就绪。"),
    "cause.two_publishers": ("Two publishers use one source.", "同一来源有两个发布者。"),
    "cause.neutral": (
        "Waiting for a neutral request: release the controls, then drive.",
        "请先松开操纵装置，再驾驶。",
    ),
    "cause.blocked": ("No room in that direction.", "该方向没有空间。"),
    "cause.no_request": ("No source requests motion.", "没有行驶请求。"),
    "cause.release": ("Creeping off the bumper.", "正在缓慢脱离碰撞。"),
    "cause.obstacle": ("Slowed by an obstacle.", "因障碍物减速。"),
    "cause.sonar": ("A sonar cannot be trusted.", "有超声波传感器不可信。"),
    # --- driving ------------------------------------------------------------------------------
    "drive": ("Drive", "驾驶"),
    "take": ("Take control", "取得控制权"),
    "leave": ("Release control", "释放控制权"),
    "take_over": ("Take over?", "接管控制权？"),
    "take_over_from": ("is driving. Take over control?", "正在驾驶。是否接管控制权？"),
    "yes": ("Yes", "是"),
    "no": ("No", "否"),
    "taken_over": ("Another viewer has taken over control.", "控制权已被其他用户接管。"),
    "take_first": ("Take control first.", "请先取得控制权。"),
    "gear": ("Gear", "挡位"),
    "reset": ("Reset", "复位"),
    "release": ("Move off the bumper, while held", "按住：缓慢脱离碰撞"),
    "release_forward": ("F  forward", "F  前进"),
    "release_backward": ("B  backward", "B  后退"),
    "believed_forward": ("Forward is believed free:", "推断前方可脱离："),
    "believed_backward": ("Backward is believed free:", "推断后方可脱离："),
    "moved_forward": ("the last motion was forward", "最近一次运动为前进"),
    "moved_backward": ("the last motion was backward", "最近一次运动为后退"),
    "ago": ("ago", "前"),
    "release_unknown": (
        "No earlier motion is known: look at the vehicle to find the free direction.",
        "没有运动记录：请目视确认可脱离的方向。",
    ),
    "release_left": ("Distance left until a reset", "复位前剩余距离"),
    "release_no_contact": ("There is no contact.", "当前没有碰撞。"),
    "release_forbidden_forward": (
        "Forward is forbidden until a reset: the bumper was pressed that way.",
        "复位前禁止前进：向前时防撞条再次被压下。",
    ),
    "release_forbidden_backward": (
        "Backward is forbidden until a reset: the bumper was pressed that way.",
        "复位前禁止后退：向后时防撞条再次被压下。",
    ),
    "release_used_up": (
        "The release distance is used up: reset first.", "脱离距离已用完：请先复位。"),
    "reset_unconfirmed": (
        "RESET NOT CONFIRMED: safety's state shows no effect. Check the screen and repeat.",
        "复位未被确认：安全服务的状态没有变化。请查看画面后重试。",
    ),
    "too_late": (
        "Refused: the command refers to an old state of the robot. Check the screen and repeat.",
        "已拒绝：该指令对应的状态已过期。请查看画面后重试。",
    ),
    "hint": (
        "Hold to drive: stick, W A S D, or gamepad with the left shoulder button. Space: E-STOP.",
        "按住行驶：摇杆、W A S D 键，或按住手柄左肩键。空格键：急停。",
    ),
    "hold.free": ("Released", "已松开"),
    "hold.held": ("Held: driving is requested", "已按住：正在请求行驶"),
    "hold.lapsed": ("Expired: release, then hold again.", "已失效：请松开后重新按住。"),
    "gamepad": ("Gamepad", "手柄"),
    "gamepad_unusable": (
        "This gamepad cannot drive: the browser does not know its buttons",
        "此手柄无法驾驶：浏览器不识别其按键",
    ),
    "barred": (
        "NOT ALLOWED: the router drops this dashboard's requests; its certificate may only watch.",
        "未获许可：路由器丢弃了本仪表板的请求，其证书只能观看。",
    ),
    "estop_unconfirmed": (
        "EMERGENCY STOP NOT CONFIRMED: use the vehicle's own switch!",
        "急停未被确认：请使用车身上的急停开关！",
    ),
    "estop_unknown": (
        "EMERGENCY STOP NOT SENT: the robot is unknown to the dashboard. Use its own switch!",
        "急停未发送：仪表板中没有该机器人。请使用车身上的急停开关！",
    ),
    "estop_asked": ("Emergency stop requested.", "已请求急停。"),
    "too_many_robots": ("Too many robots are open.", "同时打开的机器人过多。"),
    "done": ("Done.", "完成。"),
    # --- drawings -----------------------------------------------------------------------------
    "around": ("Around the vehicle", "车辆周围"),
    "trail": ("Trajectory", "轨迹"),
    "follow": ("Follow", "跟随"),
    "clear": ("Clear", "清除"),
    "charts": ("Requested, allowed, measured", "请求、允许、实测"),
    "requested": ("requested", "请求"),
    "allowed": ("allowed", "允许"),
    "measured": ("measured", "实测"),
    "chart.speed": ("Speed m/s", "速度 米/秒"),
    "chart.turn": ("Yaw rate rad/s", "角速度 弧度/秒"),
    "no_echo": ("free", "无回波"),
    "fault": ("fault", "故障"),
    "near": ("near!", "过近"),
    # --- panels -------------------------------------------------------------------------------
    "why": ("Why", "原因"),
    "no_causes": ("No restriction.", "没有限制。"),
    "limits": ("Allowed now", "当前允许"),
    "forward": ("forward", "前进"),
    "backward": ("backward", "后退"),
    "turning": ("turning", "转向"),
    "drivers": ("Motor drivers", "电机驱动器"),
    "left": ("Left", "左"),
    "right": ("Right", "右"),
    "no_fault": ("no fault", "无故障"),
    "unknown": ("unknown", "未知"),
    "bit": ("bit", "位"),
    "fault.over_current": (
        "Over-current: a wheel is blocked, or a phase is shorted.", "过流：车轮卡住或相线短路。"),
    "fault.over_voltage": (
        "Over-voltage: braking fed back more than the battery can absorb.",
        "过压：制动回馈超出电池承受。",
    ),
    "fault.encoder": ("Encoder: its cable or the sensor is faulty.", "编码器：线缆或传感器故障。"),
    "fault.under_voltage": ("Under-voltage: charge the battery.", "欠压：请给电池充电。"),
    "fault.overload": (
        "Overload: high load for too long.", "过载：电机长时间负荷过大。"),
    "fault.reserved": (
        "Not in the manual: contact the manufacturer.", "手册未定义：请联系制造商。"),
    "switches": ("The board's emergency brakes", "主板紧急制动"),
    "ultrasonic_brake": ("Sonar brake", "超声波制动"),
    "bumper_brake": ("Bumper brake", "防撞条制动"),
    "on": ("on", "开"),
    "off": ("off", "关"),
    "switch_off": (
        "Switch this brake off? Safety then inhibits all motion.",
        "是否关闭此制动？关闭后安全服务将禁止车辆移动。",
    ),
    "lights": ("Lights", "灯光"),
    "channel": ("Channel", "通道"),
    "mode": ("Mode", "模式"),
    "lightness": ("Brightness 0-10", "亮度 0-10"),
    "on_time": ("On time", "亮时长"),
    "off_time": ("Off time", "灭时长"),
    "speed_unit": ("Change speed", "变化速度"),
    "set": ("Set", "设置"),
    "services": ("Services", "服务"),
    "service": ("Service", "服务"),
    "alive": ("alive", "在线"),
    "gone": ("offline", "离线"),
    "silent": ("silent", "无心跳"),
    "version": ("Version", "版本"),
    "uptime": ("Uptime", "运行时间"),
    "lateness": ("Delay", "延迟"),
    "memory": ("Memory", "内存"),
    "counters": ("Counters", "计数"),
    "streams": ("Streams", "数据流"),
    "key": ("Key", "键"),
    "rate": ("Hz", "赫兹"),
    "age": ("Age", "时效"),
    "events": ("Events", "事件"),
    "no_events": ("No events.", "暂无事件。"),
    # --- token page -----------------------------------------------------------------------------
    "token_ask": ("Enter the token.", "请输入令牌。"),
    "token_wrong": ("The token is wrong.", "令牌不正确。"),
}  # fmt: skip

TEXTS = PAGE | EVENTS
LANGUAGES = ("en", "zh")


def table() -> dict[str, dict[str, str]]:
    """Return the texts by language, as the page gets them."""
    return {
        language: {key: words[index] for key, words in TEXTS.items()}
        for index, language in enumerate(LANGUAGES)
    }
