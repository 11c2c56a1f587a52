"""Texts of ``t2 checkout``, in English and Chinese.

The operator types the phrases that confirm an action in either language.
"""

from collections.abc import Iterable

from t2.catalogue import WORDS
from t2.messages import Field, Phrase
from t2.patrol_texts import Words
from t2.words import COMMA, GAP, Language, in_language, render

TEXTS: dict[str, Words] = {
    # dialogue
    "title": ("Checkout of robot {robot}, board {board}.", "机器人 {robot} 验收，主控板 {board}。"),
    "your_name": ("Your name:", "您的姓名："),
    "firmware": (
        "The firmware version, from the board's label:", "固件版本（见主控板标签）：",
    ),
    "begin": (
        "Press Enter to begin, or type a reason to skip:", "按回车开始，或输入跳过的原因：",
    ),
    "again": (
        "Press Enter to try again, or type a remark to continue:", "按回车重试，或输入备注并继续：",
    ),
    "any_word": (
        "Press Enter to try again, or type any word to continue:", "按回车重试，或输入任意文字继续：",
    ),
    "check_again": (
        "Press Enter to check again, or type any word to end:", "按回车重新检查，或输入任意文字结束：",
    ),
    "remark": ("{text} Remark: {remark}", "{text}备注：{remark}"),
    "confirm": ('{fact}\nType "{phrase}" to confirm:', "{fact}\n请输入“{phrase}”确认："),
    "phrase.reset": ("reset", "复位"),
    "phrase.off_ground": ("wheels off the ground", "车轮离地"),
    "phrase.ground": ("on the ground, free space", "车轮着地，空间已清空"),
    "phrase.unrecorded": ("without a recording", "不录制"),
    "done": ("{done} of {all} passed.", "{all} 项中有 {done} 项合格。"),
    "missing": ("Still missing: {titles}.", "尚未合格：{titles}。"),
    "sign": ("To sign this off, type your name ({name}):", "签名确认：请输入您的姓名（{name}）："),
    "sign_again": (
        "That is not {name}. Type it, or press Enter to leave the report unsigned:",
        "与 {name} 不符。请重新输入，或按回车不签名：",
    ),
    "ended": ("Ended early: {reason}", "提前结束：{reason}"),
    "interrupted": ("interrupted by the operator", "由操作员中断"),
    "outcome": ("{outcome}. The report: {file}", "{outcome}。报告：{file}"),
    "all_passed": ("Passed", "合格"),
    "not_passed": ("NOT PASSED", "不合格"),
    "changed": ("Changed since that report: {what}.", "自该报告以来有变化：{what}。"),
    "verdict.passed": ("passed", "合格"),
    "verdict.failed": ("failed", "不合格"),
    "verdict.skipped": ("skipped", "已跳过"),
    "found": ("{outcome}: {text}", "{outcome}：{text}"),
    # the report
    "report.title": ("Checkout of robot {robot}", "机器人 {robot} 验收报告"),
    "report.date": ("date", "日期"),
    "report.operator": ("operator", "操作员"),
    "report.what": ("what", "项目"),
    "report.value": ("value", "值"),
    "report.step": ("step", "步骤"),
    "report.result": ("result", "结果"),
    "report.finding": ("finding", "说明"),
    "report.measured": ("measured", "测量值"),
    "report.manoeuvre": ("manoeuvre", "动作"),
    "report.setting": ("setting", "设置"),
    "report.from": ("from", "来源"),
    "report.steps": ("Steps", "步骤"),
    "report.manoeuvres": ("Manoeuvres", "动作"),
    "report.settings": ("Effective settings", "生效的设置"),
    "report.signed": ("Signed off", "签名"),
    "report.unsigned": ("Not signed.", "未签名。"),
    "report.passed": ("**Passed.**", "**合格。**"),
    "report.not_passed": ("**Not passed.**", "**不合格。**"),
    "report.ended": ("Ended early: {reason}.", "提前结束：{reason}。"),
    "report.partial": (
        "Partial checkout, left out: {names}.", "部分验收，略去：{names}。",
    ),
    "figure.board": ("board", "主控板"),
    "figure.firmware": ("firmware", "固件"),
    "figure.T2 of this tool": ("T2 of this tool", "本工具的 T2 版本"),
    "figure.T2 of bridge": ("T2 of bridge", "桥接服务的 T2 版本"),
    "figure.T2 of safety": ("T2 of safety", "安全服务的 T2 版本"),
    "figure.T2 of odom": ("T2 of odom", "里程计的 T2 版本"),
    "figure.changed": ("changed since the report before", "自上一份报告以来有变化"),
    "figure.recording": ("recording", "录制"),
    "figure.commanded": ("commanded", "指令"),
    "figure.measured": ("measured", "实测"),
    "figure.counted": ("counted", "计数"),
    "figure.noise": ("noise", "噪声"),
    "figure.reaction": ("reaction", "反应时间"),
    "figure.deceleration": ("deceleration", "减速度"),
    "figure.stop distance": ("stop distance", "停车距离"),
    "figure.needed": ("needed", "实际所需"),
    "figure.reckoned": ("reckoned", "按设置预计"),
    "figure.measured over": ("measured over", "测量时长"),
    "figure.measured velocity": ("measured velocity", "实测速度"),
    "figure.counted / commanded": ("counted / commanded", "计数 / 指令"),
    "figure.standstill after": ("standstill after", "停稳用时"),
    "figure.switches confirmed on": ("switches confirmed on", "已确认开启的开关"),
    "figure.received at port": ("received at port", "接收端口"),
    "figure.relay": ("relay", "中继器"),
    "figure.rejected": ("rejected", "拒收"),
    "figure.reset": ("reset", "复位"),
    "figure.BRAKE commands received": ("BRAKE commands received", "收到的 BRAKE 指令数"),
    "figure.after": ("{action} after", "{action} 用时"),
    "figure.hand": ("hand in front of {sonar:word}", "手在{sonar:word}传感器前方"),
    "figure.detected": (
        "detected by {sonars:word}; at rest {rest}", "检测到的传感器：{sonars:word}；静止时 {rest}",
    ),
    "rate_of": ("{rate:.0f} of {expected:.0f}", "{rate:.0f}（应为 {expected:.0f}）"),
    "not_received": ("not received", "未收到"),
    "switches": (
        "ultrasonic {ultrasonic:word}, bumper {bumper:word}",
        "超声波 {ultrasonic:word}、防撞条 {bumper:word}",
    ),
    "relay.none": ("not configured", "未配置"),
    "relay.silent": ("silent", "无应答"),
    "relay.passing": ("{version}, passing", "{version}，正在转发"),
    "relay.braking": ("{version}, braking: {braking}", "{version}，正在制动：{braking}"),
    "try.fed": ("queries go on", "查询继续"),
    "try.silent": ("silence of {waited:g} s", "静默 {waited:g} s"),
    "try.drives_on": (
        "drives on for {waited:g} s, {travelled:.3f} m", "继续行驶 {waited:g} s，{travelled:.3f} m",
    ),
    "try.slows": (
        "slows at {slowed:.2f} s, {travelled:.3f} m", "{slowed:.2f} s 时减速，{travelled:.3f} m",
    ),
    "no_reading": ("no reading", "无读数"),
    "no_echo": ("no echo", "无回波"),
    "unknown": ("unknown", "未知"),
    "never": ("never", "从未"),
    "nothing": ("nothing", "无"),
    # the link
    "link.none": ("No link message from the bridge.", "未收到桥接服务的链路消息。"),
    "link.good": (
        "The board's link is up: {frames} frames, no bad CRC.",
        "与主控板的链路正常：{frames} 帧，无 CRC 错误。",
    ),
    "link.down": (
        "The link is {state} or was not up all the time: `t2 wire decode` shows the board's frames.",
        "链路未能全程保持在线（当前：{state}）：`t2 wire decode` 可显示主控板的数据帧。",
    ),
    "link.relay": (
        "The relay did not pass commands all the time; now: {relay}.",
        "中继器未能全程转发指令；当前：{relay}。",
    ),
    "link.restarted": (
        "The board restarted during this step: check its power.", "主控板在此步骤中重启：请检查其电源。",
    ),
    "link.rate": (
        "{name} has {rate:.0f} Hz, expected are {expected:.0f} Hz.",
        "{name} 为 {rate:.0f} Hz，应为 {expected:.0f} Hz。",
    ),
    "link.brakes": (
        "The board has not confirmed that both its emergency brakes are on.",
        "主控板尚未确认两个紧急制动均已开启。",
    ),
    "link.few": (
        "Too few frames for a verdict: {frames}. Was the bridge running all the time?",
        "帧数过少，无法判定：{frames}。桥接服务是否全程运行？",
    ),
    "link.crc": (
        "{bad} bad CRCs against {frames} good frames: this firmware has another CRC than CRC-16/ARC "
        "over the payload (common/wire/framing.py).",
        "{bad} 帧 CRC 错误，{frames} 帧正确：此固件的 CRC 不是对负载计算的 CRC-16/ARC"
        "（common/wire/framing.py）。",
    ),
    "link.cable": (
        "{bad} bad CRCs against {frames} good frames: check the cable and its connectors.",
        "{bad} 帧 CRC 错误，{frames} 帧正确：请检查线缆及其接头。",
    ),
    "link.rejected": (
        "{count} frames rejected as {reason}: `t2 wire decode` shows them.",
        "{count} 帧因 {reason} 被拒收：`t2 wire decode` 可显示。",
    ),
    # sonars
    "sonar.none": ("No ranges are received: see the link.", "未收到测距数据：请查看链路。"),
    "sonar.clear": (
        "Clear {room:g} m all around: {tight}.", "请清空四周 {room:g} m：{tight}。",
    ),
    "sonar.reading": ("{sonar:word} {distance:.2f} m", "{sonar:word} {distance:.2f} m"),
    "sonar.is_faulty": ("The {sonar:word} sonar is faulty.", "{sonar:word}超声波传感器故障。"),
    "sonar.now": (
        "NOW the {sonar:word} sonar: hold a hand in front of it, within {seconds:g} s.",
        "现在测试{sonar:word}超声波传感器：请在 {seconds:g} 秒内将手放在其前方。",
    ),
    "sonar.seen": (
        "  detected by: {sonars:word}. Take the hand away.", "  检测到的传感器：{sonars:word}。请把手移开。",
    ),
    "sonar.still": (
        "A sonar still detects it: take it away and press Enter, or type any word to go on:",
        "仍检测到物体：请移开后按回车，或输入任意文字继续：",
    ),
    "sonar.unseen": ("  no sonar has detected it.", "  没有传感器检测到。"),
    "sonar.next": (
        "Press Enter for the next sonar, or type a reason to leave this step:",
        "按回车测试下一个传感器，或输入离开此步骤的原因：",
    ),
    "sonar.left": (
        "Left after {done} of {all} sonars: {reason}.", "测试 {all} 个传感器中的 {done} 个后离开：{reason}。",
    ),
    "sonar.good": ("Each sonar is in its place.", "各超声波传感器位置正确。"),
    "sonar.fault": (
        "{sonar:word} is faulty: the board reports 0xFFFF.", "{sonar:word}传感器故障：主控板报告 0xFFFF。",
    ),
    "sonar.missed": (
        "{sonar:word}: no sonar detected the hand.", "{sonar:word}：没有传感器检测到手。",
    ),
    "sonar.other": (
        "{sonar:word}: the hand was detected by {sonars:word}.", "{sonar:word}：检测到手的是{sonars:word}。",
    ),
    # bumper, emergency stop
    "bumper.none": (
        "No bumper messages are received: see the link.", "未收到防撞条消息：请查看链路。",
    ),
    "bumper.before": (
        "The bumper is pressed before the test: stuck or inverted.", "测试前防撞条已被压下：卡住或信号反相。",
    ),
    "bumper.now": (
        "NOW press the bumper, within {seconds:g} s.", "现在请在 {seconds:g} 秒内压下防撞条。",
    ),
    "bumper.no_press": (
        "No press was received: is the strip connected?", "未收到压下信号：防撞条是否已连接？",
    ),
    "bumper.let_go": ("Pressed. NOW let go of it.", "已压下。现在请松开。"),
    "bumper.stays": (
        "The bumper stays pressed after you let go of it.", "松开后防撞条仍显示被压下。",
    ),
    "latch.good": ("Latched, braked, reset.", "已锁定、制动并复位。"),
    "latch.latch": ("latch {cause}", "锁定 {cause}"),
    "latch.brake": ("command BRAKE", "发出制动指令"),
    "latch.not": ("Safety did not {action}.", "安全服务未{action}。"),
    "latch.late": (
        "Safety took {took:.2f} s to {action}, the limit is {limit:g} s.",
        "安全服务经 {took:.2f} s 才{action}，上限为 {limit:g} s。",
    ),
    "latch.others": (
        "Before the reset, safety sent {commands} instead of BRAKE.",
        "复位之前，安全服务发出了 {commands}，而不是 BRAKE。",
    ),
    "latch.reset": ("The reset failed: {text}", "复位失败：{text}"),
    "latch.after": (
        "Latched after the reset: {causes}.", "复位后锁定：{causes}。",
    ),
    "latch.before": (
        "Safety has latched before: {causes}. Reset it first.", "安全服务此前已锁定：{causes}。请先复位。",
    ),
    "latch.not_reset": (
        "The earlier latch of safety was not reset.", "安全服务此前的锁定未复位。",
    ),
    # motion of the wheels
    "off_ground": (
        "The wheels will turn. All of them must be off the ground.", "车轮即将转动。所有车轮必须离地。",
    ),
    "not_confirmed": (
        "Not confirmed: no motion was requested.", "未确认：没有发出行驶指令。",
    ),
    "turning": ("The wheels turn. Ctrl-C stops them.", "车轮正在转动。按 Ctrl-C 停车。"),
    "not_granted": (
        "Safety does not grant motion to the checkout. It reports: {text}",
        "安全服务不允许验收程序行驶，原因：{text}",
    ),
    "no_state": ("no state", "无状态"),
    "and_bridge": ("{text} The bridge: {waiting}", "{text}桥接服务：{waiting}"),
    "motion.good": (
        "The board counts {counted} {unit} of {commanded} commanded.",
        "主控板计数为 {counted} {unit}，指令为 {commanded}。",
    ),
    "motion.not_stood": (
        "It did not stand within {limit:g} s after the release.", "松开后 {limit:g} s 内未停稳。",
    ),
    "motion.sign": (
        "The sign is wrong: on a positive command it goes {way:word}.",
        "方向相反：正向指令时{way:word}行驶。",
    ),
    "motion.clockwise": (
        "The sign is wrong: on a positive command it goes clockwise.", "方向相反：正向指令时顺时针转动。",
    ),
    "motion.ratio": (
        "It goes {ratio:.2f} times as fast as commanded.", "速度为指令的 {ratio:.2f} 倍。",
    ),
    "motion.measured_sign": (
        "The measured velocity has the wrong sign: it contradicts the counter.",
        "实测速度方向相反：与计数矛盾。",
    ),
    "motion.measured": (
        "The measured velocity is {ratio:.2f} times the velocity of the counter.",
        "实测速度为计数速度的 {ratio:.2f} 倍。",
    ),
    "motion.none_distance": (
        "No motion: neither the velocity nor the distance changes.", "没有运动：速度和距离均无变化。",
    ),
    "motion.none_heading": (
        "No motion: neither the velocity nor the heading changes.", "没有运动：速度和航向均无变化。",
    ),
    "motion.no_distance": (
        "The velocity changes, but the distance does not.", "速度有变化，但距离没有变化。",
    ),
    "motion.no_heading": (
        "The velocity changes, but the heading does not. A heading from a gyroscope counts only on "
        "the ground.",
        "速度有变化，但航向没有变化。陀螺仪航向仅在落地时计数。",
    ),
    "motion.unit": (
        'The firmware has another unit: set wire.{direction}_angular_unit = "{unit}".',
        '固件的单位不同：请设置 wire.{direction}_angular_unit = "{unit}"。',
    ),
    "motion.too_short": (
        "Safety did not grant the full speed for long enough to measure. Measured at most {peak:.2f} "
        "{unit} of {requested:.2f} requested.",
        "安全服务允许全速的时间过短，无法测量。实测最大 {peak:.2f} {unit}，要求 {requested:.2f}。",
    ),
    "motion.reports": ("Safety reports: {text}", "安全服务的原因：{text}"),
    # the guided drive and the watchdog
    "manoeuvre.standstill": ("Standstill", "静止"),
    "manoeuvre.full_turn": ("Full turn left at {speed}", "向左转一整圈，{speed}"),
    "manoeuvre.return": ("Return {way:word} by {distance:.2f} m", "{way:word}返回 {distance:.2f} m"),
    "manoeuvre.stop": ("STOP {way} from {speed}", "{way}，{speed} 时 STOP"),
    "manoeuvre.brake": ("BRAKE {way} from {speed}", "{way}，{speed} 时 BRAKE"),
    "manoeuvre.slow": ("Slow down {way} from {speed}", "{way}，从 {speed} 减速"),
    "manoeuvre.driving": ("{way:word}", "{way:word}"),
    "manoeuvre.turning": ("{way:word}", "原地{way:word}转"),
    "manoeuvre.curve": ("{way:word} turning {side:word}", "{way:word}并{side:word}转"),
    "manoeuvre.missing": (
        "{ending} {way}: {count} of {number}", "{way} {ending}：{number} 次中还缺 {count} 次",
    ),
    "earlier": ("{text} Before that: {earlier}", "{text}此前：{earlier}"),
    "incomplete": ("Not completed.", "未完成。"),
    "watchdog.alone": ("all but the watchdog", "看门狗以外的全部项目"),
    "drive.return": ("the return ({reason})", "返回（{reason}）"),
    "drive.excluded": (
        "{count} manoeuvres by --only or --space", "{count} 个动作（--only 或 --space）",
    ),
    "drive.no_recording": ("none: {problem}", "无：{problem}"),
    "drive.warning": (
        "The vehicle drives on the ground. Hold the vehicle's own stop switch, and keep everybody "
        "away from it.\nMark its place on the ground. Each motion is announced with the free space "
        "that it needs.\nSTOP: the checkout stops publishing, and its lease ends. BRAKE: it publishes "
        "an emergency stop, and resets it.\nSlow down: it requests zero. Ctrl-C is an emergency stop, "
        "and ends the drive.",
        "车辆将在地面上行驶。请手握车身上的急停开关，任何人不得靠近车辆。\n"
        "请在地面上标记车辆位置。每个动作开始前会说明所需的空间。\n"
        "STOP：验收程序停止发送，指令失效。BRAKE：验收程序触发急停，然后复位。\n"
        "减速：验收程序要求零速。按 Ctrl-C 即急停，并结束行驶。",
    ),
    "drive.ground": (
        "All wheels stand on the ground, and the space is free.", "所有车轮均已着地，周围空间已清空。",
    ),
    "drive.not_confirmed": (
        "not confirmed: no motion was requested", "未确认：没有发出行驶指令",
    ),
    "drive.ended": ("Ended: {text}.", "已结束：{text}。"),
    "drive.interrupted": (
        "interrupted by the operator, by an emergency stop; safety has latched: {causes}",
        "由操作员以急停中断；安全服务已锁定：{causes}",
    ),
    "drive.and": ("; ", "；"),
    "drive.not_latched": (
        "the emergency stop is NOT CONFIRMED", "急停未被确认",
    ),
    "drive.reset_hint": ("Reset it with `t2 drive`.", "请用 `t2 drive` 复位。"),
    "drive.own_switch": (
        "Stop the vehicle with its own switch.", "请用车身上的急停开关停车。",
    ),
    "drive.missing": (
        "Stops that are still missing for a fit: {stops}.", "拟合仍缺少的停车：{stops}。",
    ),
    "drive.over": (
        "The drive is over. End `t2 record` with Ctrl-C.", "行驶结束。请按 Ctrl-C 结束 `t2 record`。",
    ),
    "drive.left_out": ("{title}: left out, {why}", "{title}：略去，{why}"),
    "drive.not_granted": (
        "Safety does not grant motion. It reports: {text}", "安全服务不允许行驶，原因：{text}",
    ),
    "drive.unplanned": (
        "It was not planned: find out why.", "该急停不在计划内：请查明原因。",
    ),
    "drive.stays": (
        "The emergency stop stays latched. {why} The next motion asks you for its reset; `t2 drive` "
        "can reset it, too.",
        "急停仍然锁定。{why}下一个动作前会询问是否复位；也可用 `t2 drive` 复位。",
    ),
    "drive.faster": (
        "faster than {title}, which failed.", "其速度高于不合格的“{title}”。",
    ),
    "drive.omitted": ("Left out: {why}", "略去：{why}"),
    "drive.counters": (
        "The counters have started again, so the way back is unknown.", "计数已重新开始，无法得知返回路线。",
    ),
    "drive.where": (
        "By its counters it stands {distance:.2f} m from where it began.", "按计数，车辆距起点 {distance:.2f} m。",
    ),
    "drive.no_return": (
        "By its counters it stands {distance:.2f} m from where it began, {reason}: the return is left "
        "out. Drive it back with `t2 drive`.",
        "按计数，车辆距起点 {distance:.2f} m，{reason}：不自动返回。请用 `t2 drive` 驾驶回起点。",
    ),
    "drive.turned": ("turned by {degrees:.0f} degrees", "已转过 {degrees:.0f} 度"),
    "drive.return_needs": (
        "its way back needs {distance:.1f} m", "返回需要 {distance:.1f} m",
    ),
    # a motion, and the space that it needs
    "space.stands": (
        "No action needed: the vehicle stands for {seconds:g} s. Do not touch it.",
        "无需操作：车辆静止 {seconds:g} 秒。请勿触碰。",
    ),
    "space.needs": (
        "It needs {space}. It drives for at most {reach} and {seconds} s, then stops.",
        "所需空间：{space}。最多行驶 {reach}、{seconds} 秒，然后停车。",
    ),
    "space.around": ("{around} around the vehicle's middle", "车辆中心周围 {around}"),
    "space.ahead": ("{ahead} ahead", "前方 {ahead}"),
    "space.behind": ("{ahead} behind", "后方 {ahead}"),
    "space.curve_ahead": (
        "{ahead} ahead and {aside} to the {side:word}", "前方 {ahead}，{side:word}侧 {aside}",
    ),
    "space.curve_behind": (
        "{ahead} behind and {aside} to the {side:word}", "后方 {ahead}，{side:word}侧 {aside}",
    ),
    "reach.linear": ("{linear:.1f} m", "{linear:.1f} m"),
    "reach.angular": ("{degrees:.0f} degrees", "{degrees:.0f} 度"),
    "reach.both": (
        "{linear:.1f} m or {degrees:.0f} degrees", "{linear:.1f} m 或 {degrees:.0f} 度",
    ),
    # what ends a motion
    "end.no_stop": (
        "No STOP followed the end of its requests, RUN went on: an emergency stop has ended it. Does "
        "another program publish as `{source}`? Look at safety.sources.{source}.lease.",
        "停止请求后没有 STOP，RUN 仍在继续：已用急停结束。是否有其他程序以 `{source}` 发布？"
        "请检查 safety.sources.{source}.lease。",
    ),
    "end.pressed": (
        "Another emergency stop has arrived, as of an operator: find out why.",
        "收到另一次急停，可能由操作员触发：请查明原因。",
    ),
    "end.not_received": (
        "Its own emergency stops are not received back: another one would not be either.",
        "收不到自身发出的急停：其他急停也可能收不到。",
    ),
    "end.latched": (
        "Safety has latched {causes}: find out why.", "安全服务已锁定 {causes}：请查明原因。",
    ),
    "end.stopped": ("Safety stopped it: {text}", "安全服务已停车：{text}"),
    "end.lost_velocity": (
        "Nothing is received of the velocity for {seconds:g} s while it moves: run `t2 checkout "
        "--only link`.",
        "行驶中 {seconds:g} s 未收到速度：请运行 `t2 checkout --only link`。",
    ),
    "end.lost_counters": (
        "Nothing is received of the counters for {seconds:g} s while it moves: run `t2 checkout "
        "--only link`.",
        "行驶中 {seconds:g} s 未收到计数：请运行 `t2 checkout --only link`。",
    ),
    "end.other": (
        "Another source drives, {source}: end it first.", "{source} 正在驾驶：请先将其结束。",
    ),
    "end.sign_linear": (
        "Wrong sign: by the {by} it has travelled {way:+.2f} m on a request of {wanted:+.2f} m/s. "
        "Repeat `t2 checkout --only forward`, wheels off the ground.",
        "方向相反（{by}）：要求 {wanted:+.2f} m/s，实际移动 {way:+.2f} m。请将车轮离地，重做 "
        "`t2 checkout --only forward`。",
    ),
    "end.sign_angular": (
        "Wrong sign: by the {by} it has turned {way:+.2f} rad on a request of {wanted:+.2f} rad/s "
        "(left is positive). Repeat `t2 checkout --only turn`, wheels off the ground.",
        "方向相反（{by}）：要求 {wanted:+.2f} rad/s，实际转过 {way:+.2f} rad（左为正）。请将车轮离地，重做 "
        "`t2 checkout --only turn`。",
    ),
    "by.counters": ("counters", "按计数"),
    "by.velocities": ("velocities", "按速度"),
    "end.fast_linear": (
        "Too fast: the board measures {measured}, requested are {wanted}: check the board's scale of "
        "the speed.",
        "过快：主控板实测 {measured}，要求 {wanted}：请检查主控板的速度比例。",
    ),
    "end.fast_angular": (
        "Too fast: the board measures {measured}, requested are {wanted}: check "
        "wire.command_angular_unit and wire.feedback_angular_unit with `t2 checkout --only turn`.",
        "过快：主控板实测 {measured}，要求 {wanted}：请用 `t2 checkout --only turn` 检查 "
        "wire.command_angular_unit 和 wire.feedback_angular_unit。",
    ),
    "end.drift_straight": (
        "Drift: on a straight line it has turned {degrees:.0f} degrees to the {side:word} within "
        "{distance:.2f} m: check tyres, wheel alignment and ground.",
        "跑偏：直行 {distance:.2f} m 内向{side:word}偏转 {degrees:.0f} 度：请检查轮胎、车轮定位和地面。",
    ),
    "end.drift_turn": (
        "Drift: in a turn on the spot it has travelled {distance:.2f} m {way:word}: check the "
        "steering of all wheels.",
        "跑偏：原地转向时{way:word}移动了 {distance:.2f} m：请检查各车轮的转向。",
    ),
    "end.unlike_m": (
        "Counters and velocities differ by {share:.0%}: counted {counted:+.2f} m, by the velocities "
        "{integrated:+.2f} m: check the scale of counters and velocity with `t2 wire decode`.",
        "计数与速度相差 {share:.0%}：计数 {counted:+.2f} m，按速度 {integrated:+.2f} m：请用 `t2 wire decode` "
        "检查计数和速度的比例。",
    ),
    "end.unlike_rad": (
        "Counters and velocities differ by {share:.0%}: counted {counted:+.2f} rad, by the velocities "
        "{integrated:+.2f} rad: check wire.feedback_angular_unit with `t2 checkout --only turn`.",
        "计数与速度相差 {share:.0%}：计数 {counted:+.2f} rad，按速度 {integrated:+.2f} rad：请用 "
        "`t2 checkout --only turn` 检查 wire.feedback_angular_unit。",
    ),
    # verdicts of the guided drive
    "judge.stands": ("It stands.", "车辆静止。"),
    "judge.travelled": (
        "It has travelled {linear:+.2f} m, as expected.", "移动 {linear:+.2f} m，符合预期。",
    ),
    "judge.turned": (
        "It has turned {degrees:+.0f} degrees, as expected.", "转过 {degrees:+.0f} 度，符合预期。",
    ),
    "judge.both": (
        "It has travelled {linear:+.2f} m and turned {degrees:+.0f} degrees, as expected.",
        "移动 {linear:+.2f} m，转过 {degrees:+.0f} 度，符合预期。",
    ),
    "judge.not_stood": (
        "It does not stand: it was stopped by an emergency stop. Look at it.",
        "车辆未停稳：已用急停停车。请查看车辆。",
    ),
    "judge.no_data": (
        "No velocities or no counters: run `t2 checkout --only link`.",
        "没有速度或计数：请运行 `t2 checkout --only link`。",
    ),
    "judge.no_end": (
        "The velocities end too early: run `t2 checkout --only link`.",
        "速度数据过早结束：请运行 `t2 checkout --only link`。",
    ),
    "judge.unmeasured": (
        "The stop cannot be measured: {reason}.", "无法测量停车：{reason}。",
    ),
    "judge.other_end": ("It ended by {kind} instead.", "实际以 {kind} 结束。"),
    "judge.granted": (
        "Safety granted at most {top} of {wanted}.", "安全服务最多允许 {top}，要求 {wanted}。",
    ),
    "judge.reports": ("It reports: {text}", "原因：{text}"),
    "judge.little": ("It had too little space or time.", "空间或时间不足。"),
    "judge.no_motion": (
        "No motion: {counted:.2f} {unit} are counted on a request of {wanted:.2f} {unit}/s. If the "
        "vehicle has moved, end the drive with Ctrl-C and repeat `t2 checkout`. If not, its wheels "
        "may need a higher speed: continue.",
        "没有运动：要求 {wanted:.2f} {unit}/s，计数为 {counted:.2f} {unit}。若车辆已移动，请按 Ctrl-C 结束并重做 "
        "`t2 checkout`；若未移动，车轮可能需要更高的速度：请继续。",
    ),
    "judge.slow_linear": (
        "Too slow: the board measures {found:+.2f} m/s, granted are {wanted:+.2f} m/s: check whether "
        "the wheels slip or the vehicle is too heavy.",
        "过慢：主控板实测 {found:+.2f} m/s，允许 {wanted:+.2f} m/s：请检查车轮是否打滑或车辆是否过重。",
    ),
    "judge.slow_angular": (
        "Too slow: the board measures {found:+.2f} rad/s, granted are {wanted:+.2f} rad/s: check "
        "wire.command_angular_unit and whether the wheels slip or the vehicle is too heavy.",
        "过慢：主控板实测 {found:+.2f} rad/s，允许 {wanted:+.2f} rad/s：请检查 wire.command_angular_unit，"
        "以及车轮是否打滑或车辆是否过重。",
    ),
    "judge.unsteady": (
        "The speed was not steady within {reach} and {seconds:.0f} s: the vehicle accelerates too "
        "slowly, or its velocity is too noisy.",
        "{reach}、{seconds:.0f} 秒内速度未稳定：车辆加速过慢，或速度噪声过大。",
    ),
    "judge.way": (
        "from {speed:.2f} {unit}/s it needs {way:.3f} {unit}, the settings reckon with {allowed:.3f} "
        "{unit}",
        "自 {speed:.2f} {unit}/s 停车需要 {way:.3f} {unit}，设置按 {allowed:.3f} {unit} 计算",
    ),
    "judge.braked": (
        "Safety commanded BRAKE after the STOP, because it rolled on: {figures}. Drive on level "
        "ground.",
        "STOP 之后车辆继续滑行，安全服务发出了 BRAKE：{figures}。请在平地上行驶。",
    ),
    "judge.long": (
        "The stop was too long: {figures}. Do not drive faster: set {change}.",
        "停车过长：{figures}。请勿提高速度，并设置 {change}。",
    ),
    "judge.react": (
        "safety.react to at least {least:.2f} s (it is {now:g})", "safety.react 至少 {least:.2f} s（当前 {now:g}）",
    ),
    "judge.deceleration": (
        "vehicle.{name} to at most {most:.2f} {unit}/s2 (it is {now:g})",
        "vehicle.{name} 至多 {most:.2f} {unit}/s2（当前 {now:g}）",
    ),
    "judge.and": (" and ", "，以及 "),
    "judge.either": ("safety.react or vehicle.{name}", "safety.react 或 vehicle.{name}"),
    "judge.rare": (
        "A velocity arrives each {period:.2f} s only, too rarely to watch a stop: run `t2 checkout "
        "drive` on the robot, over ssh.",
        "每 {period:.2f} s 才收到一次速度，无法观察停车：请通过 ssh 在机器人上运行 `t2 checkout drive`。",
    ),
    "judge.bias": (
        "At standstill the board measures {linear:+.3f} m/s and {angular:+.3f} rad/s; below "
        "{still:g} m/s and {still_angular:g} rad/s counts as standstill. Does it roll? Otherwise have "
        "the board's velocity corrected.",
        "静止时主控板实测 {linear:+.3f} m/s、{angular:+.3f} rad/s；低于 {still:g} m/s 和 {still_angular:g} rad/s "
        "才视为静止。车辆是否在滑动？否则请修正主控板的速度。",
    ),
    "judge.driven": (
        "Another program drives: end it first.", "其他程序正在驾驶：请先将其结束。",
    ),
    # conditions of the guided drive
    "recorder.start": (
        "start `t2 record` on the robot, in another terminal", "请在机器人上另开一个终端运行 `t2 record`",
    ),
    "recorder.none": ("No recorder is running: {start}.", "没有记录器在运行：{start}。"),
    "recorder.incidents": (
        "The recorder keeps incidents only (recorder.everything = false), or its disk is full: "
        "{start}.",
        "记录器只保存事故（recorder.everything = false），或其磁盘已满：{start}。",
    ),
    "recorder.elsewhere": (
        "The recorder is on another computer, which gets fewer messages: {start}.",
        "记录器在另一台计算机上，收到的消息较少：{start}。",
    ),
    "drive.switches": (
        "The board has not confirmed that both its emergency brakes are on: run `t2 checkout --only "
        "link`.",
        "主控板尚未确认两个紧急制动均已开启：请运行 `t2 checkout --only link`。",
    ),
    "drive.unrecorded": ("NOT RECORDED: {problem}", "未录制：{problem}"),
    "drive.unrecorded_ask": (
        'Press Enter to check again, type "{phrase}" to go on all the same, or any other text to end:',
        "按回车重新检查，输入“{phrase}”照常继续，输入其他文字结束：",
    ),
    "watchdog.warning": (
        "This speaks to the board itself, without safety and guard: the wheels turn forward at "
        "{speed:g} m/s, and are left turning for some seconds without a command. Vehicle on blocks, a "
        "hand on its own stop switch: nothing else stops it if this computer fails meanwhile.\n"
        "Keep everything away from bumper and sonars: the board's own brakes would stop the wheels.",
        "本测试直接与主控板通信，不经过安全服务和守护进程：车轮以 {speed:g} m/s 向前转动，随后数秒内没有指令而继续转动。"
        "请将车辆架起，手放在车身上的急停开关上：此时若本计算机故障，没有其他方法停车。\n"
        "防撞条和超声波传感器附近不得有物体：否则主控板的紧急制动会使车轮停转。",
    ),
    "watchdog.unreliable": (
        "The board has no watchdog that can be relied on.", "主控板没有可靠的看门狗。",
    ),
    "watchdog.opposite": (
        "The wheels stopped while queries went on, but drove on in silence.",
        "查询继续时车轮停转，静默时却继续转动。",
    ),
    "watchdog.stops": (
        "The board stops by itself {after} after the last motion command.",
        "主控板在最后一条运动指令之后 {after} 自行停车。",
    ),
    "watchdog.stops_both": (
        "The board stops by itself {after} after the last motion command; in silence {silence}.",
        "主控板在最后一条运动指令之后 {after} 自行停车；静默时为 {silence}。",
    ),
    "watchdog.silent": (
        "The board drives on for at least {seconds:g} s without a motion command while queries go on: "
        "they feed its watchdog. In silence it stops by itself {after} after the last frame.",
        "没有运动指令但查询继续时，主控板至少继续行驶 {seconds:g} s：查询会喂看门狗。静默时在最后一帧之后 {after} 自行停车。",
    ),
    "watchdog.none": (
        "The board drives on for at least {seconds:g} s without a motion command, and for {silence:g} "
        "s without any frame: it has no watchdog. When the computer loses power, only the stop switch "
        "stops the vehicle, or a relay (docs/relay.md).",
        "没有运动指令时主控板至少继续行驶 {seconds:g} s，没有任何数据帧时至少 {silence:g} s：它没有看门狗。"
        "工控机断电后只有急停开关或中继器（docs/relay.md）能停车。",
    ),
    "watchdog.no_try": ("No try was complete.", "没有一次测试完成。"),
    "watchdog.contradiction": (
        "It stopped {after} after the last command in {count} of {all} tries {how}, and drove on for "
        "{seconds:g} s in another one.",
        "{how}的 {all} 次测试中有 {count} 次在最后一条指令之后 {after} 停车，另有一次继续行驶 {seconds:g} s。",
    ),
    "watchdog.fed": ("with queries", "查询继续时"),
    "watchdog.silence": ("in silence", "静默时"),
    "watchdog.after": (
        "{mean:.2f} s ({least:.2f} to {most:.2f} in {count} tries)",
        "{mean:.2f} s（{count} 次，{least:.2f} 至 {most:.2f}）",
    ),
    "watchdog.after_one": (
        "{mean:.2f} s ({least:.2f} to {most:.2f} in {count} try)",
        "{mean:.2f} s（{count} 次，{least:.2f} 至 {most:.2f}）",
    ),
    "watchdog.title": ("The board's own watchdog", "主控板自身的看门狗"),
    # what ends the watchdog's test
    "board.not_turning": (
        "the wheels do not turn: {measured:.3f} m/s after {seconds:g} s of RUN at {speed:g} m/s. Is the "
        "vehicle's stop switch released, the bumper free, and nothing near the sonars? See the step "
        "`forward` of `t2 checkout`",
        "车轮未转动：以 {speed:g} m/s 发送 RUN {seconds:g} s 后为 {measured:.3f} m/s。请确认急停开关已松开、"
        "防撞条未被压下、超声波传感器附近无物体。参见 `t2 checkout` 的 `forward` 步骤",
    ),
    "board.fast": (
        "the board measures {measured:.2f} m/s: braked", "主控板实测 {measured:.2f} m/s：已制动",
    ),
    "board.bumper": (
        "the bumper was pressed: braked. Release it, and begin again",
        "防撞条被压下：已制动。请松开防撞条，重新开始",
    ),
    "board.driver": (
        "the {side:word} motor driver reports fault bits {bits}",
        "{side:word}侧电机驱动器报告故障位 {bits}",
    ),
    "board.not_standing": (
        "the wheels do not stand at the beginning: stop them by their switch",
        "开始时车轮未静止：请用急停开关停车",
    ),
    "board.not_stopping": (
        "THE WHEELS DO NOT STOP on STOP and BRAKE: use the vehicle's stop switch",
        "STOP 和 BRAKE 均未使车轮停转：请使用车身上的急停开关",
    ),
    "board.silent_counters": (
        "the board does not answer a query of its counters after the silence",
        "静默之后主控板对计数查询无应答",
    ),
    "board.no_velocity": (
        "no velocity from the board at {board}: is it on? Try `t2 doctor`",
        "未收到主控板 {board} 的速度：是否已通电？请运行 `t2 doctor`",
    ),
    "board.no_counters": (
        "the board at {board} does not answer queries of its counters", "主控板 {board} 对计数查询无应答",
    ),
    "watchdog.turning": (
        "The wheels turn, stop and turn again, for up to {seconds:.0f} s. Ctrl-C brakes.",
        "车轮将反复转动和停止，最长 {seconds:.0f} s。按 Ctrl-C 制动。",
    ),
}  # fmt: skip


class Say:
    """The texts in one language."""

    def __init__(self, language: Language = "en") -> None:
        self.language = language

    def __call__(self, name: str, /, **fields: Field) -> str:
        """Return a text by its name; raise ``KeyError`` without it."""
        if name not in TEXTS:
            raise KeyError(name)
        return render((Phrase(name, fields),), self.language, texts=TEXTS)

    def figure(self, name: str) -> str:
        """Return the name of a measured figure, of which a unit may follow a comma."""
        what, comma, unit = name.partition(", ")
        words = TEXTS.get(f"figure.{what}")
        return f"{self.of(words)}{comma}{unit}" if words else name

    def causes(self, names: Iterable[str]) -> tuple[str, ...] | str:
        """Return the names of latched causes, in English as in settings and events; or none."""
        is_english = self.language == "en"
        found = (name if is_english else self.of(WORDS.get(name, (name, name))) for name in names)
        return tuple(found) or self("nothing")

    def of(self, words: Words) -> str:
        """Return a pair of texts in the language."""
        return in_language(words, self.language)

    def sentences(self, texts: Iterable[str]) -> str:
        """Return sentences one after the other."""
        return GAP[self.language].join(filter(None, texts))

    def joined(self, texts: Iterable[str]) -> str:
        """Return texts as a list in a sentence."""
        return COMMA[self.language].join(texts)


ENGLISH = Say()
