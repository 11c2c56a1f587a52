"""Findings of ``t2 doctor``: their texts and remedies, in English and Chinese.

The texts and remedies of safety's causes are those of ``t2.catalogue``.
"""

from dataclasses import dataclass
from typing import Literal

from t2 import catalogue
from t2.messages import Field, Phrase, Phrases
from t2.patrol_texts import Words
from t2.words import Language, render

Level = Literal["ok", "note", "wrong", "unknown"]

FINDINGS: dict[str, Words] = {
    "text": ("{text}", "{text}"),  # of a message that has no phrases
    # network, router
    "network.untested": ("{endpoint} cannot be tested by itself", "{endpoint} 无法单独测试"),
    "network.answers": ("{endpoint} answers in {ms:.1f} ms", "{endpoint} 在 {ms:.1f} ms 内应答"),
    "network.at": ("{endpoint}:", "{endpoint}："),
    "network.no_socket": ("the socket file is missing", "套接字文件不存在"),
    "network.unknown_host": ("unknown host name {host}", "未知的主机名 {host}"),
    "network.refused": (
        "connection refused: the host is up, but nothing listens", "连接被拒绝：主机在线，但没有程序监听",
    ),
    "network.no_answer": ("no answer", "无应答"),
    "network.error": ("{reason}", "{reason}"),
    "network.file": ("bus.{name} {problem}", "bus.{name} {problem}"),
    "network.files": (
        "bus.ca, bus.certificate or bus.private_key is invalid: {reason}",
        "bus.ca、bus.certificate 或 bus.private_key 无效：{reason}",
    ),
    "network.untrusted": (
        "the router's certificate is not trusted: {reason}", "路由器的证书不可信：{reason}",
    ),
    "network.certificate_refused": (
        "the router refuses this certificate: {reason}", "路由器拒绝此证书：{reason}",
    ),
    "network.closed": (
        "the router closes the connection on this certificate", "路由器因此证书关闭连接",
    ),
    "router.unreachable": (
        "router unreachable; later checks are skipped", "无法连接路由器，跳过后续检查",
    ),
    "router.other": (
        "the endpoint accepts connections but is not a router", "该端点接受连接，但不是路由器",
    ),
    "network.dropped": (
        "{path} is sent with {hz:.0f} Hz and does not arrive here",
        "{path} 以 {hz:.0f} Hz 发送，但未到达此处",
    ),
    # services, versions
    "robot.wrong": (
        "no service of robot {robot} is here; the router knows {others}",
        "此处没有机器人 {robot} 的服务；路由器已知的有 {others}",
    ),
    "services.absent_one": ("{names:service} is not running", "{names:service}未运行"),
    "services.absent": ("{names:service} are not running", "{names:service}未运行"),
    "camera.twice": (
        "camera {name}: two programs publish pictures under this name",
        "摄像头 {name}：两个程序以此名称发布图像",
    ),
    "services.no_recorder": (
        "the recorder is not running, or hangs: nothing is recorded, and the shift log has a gap",
        "记录器未运行或无响应：没有录制，值班日志将出现空白",
    ),
    "services.optional": (
        "not running, and needed only where they are used: {names:service}",
        "未运行（仅在使用时需要）：{names:service}",
    ),
    "services.unlisted_one": (
        "{names:service} is perhaps running: the router did not list the services in time",
        "{names:service}可能在运行：路由器未及时列出服务",
    ),
    "services.unlisted": (
        "{names:service} are perhaps running: the router did not list the services in time",
        "{names:service}可能在运行：路由器未及时列出服务",
    ),
    "services.duplicate": ("{name:service} is running {count} times", "{name:service}运行了 {count} 个实例"),
    "services.hangs": (
        "{name:service} is running and publishes no health: it hangs", "{name:service}在运行，但不发布健康状态：已停止响应",
    ),
    "services.stalls": ("{name:service} stalls for up to {lateness:.2f} s", "{name:service}停顿最长 {lateness:.2f} s"),
    "services.up": ("{name:service} is up for {uptime:.0f} s", "{name:service}已运行 {uptime:.0f} s"),
    "versions.other": (
        "{name:service} is T2 {version}, this laptop {t2}", "{name:service}的版本为 T2 {version}，本机为 {t2}",
    ),
    "versions.same": ("T2 {t2} everywhere", "版本均为 T2 {t2}"),
    "versions.undecodable": ("{path}: {reason}", "{path}：{reason}"),
    # rights; those before another right end with a semicolon
    "rights.stranger": ("this router does not know {name}", "此路由器不认识 {name}"),
    "rights.no_service": ("no service found", "未发现服务"),
    "rights.no_message": ("services run, but no message arrives", "服务在运行，但收不到消息"),
    "rights.no_safety": ("driving and calls require safety", "驾驶和调用需要安全服务"),
    "rights.read_and": ("this laptop may read;", "本机可以读取；"),
    "rights.only_read": ("this laptop may only read", "本机只能读取"),
    "rights.only_read_and": ("this laptop may only read;", "本机只能读取；"),
    "rights.read_and_stop": ("this laptop may read and stop", "本机可以读取和急停"),
    "rights.drive": ("drive as {names}", "以 {names} 驾驶"),
    "rights.drive_and": ("drive as {names};", "以 {names} 驾驶；"),
    "rights.limit": ("limit as {names}", "以 {names} 限速"),
    "rights.limit_and": ("limit as {names};", "以 {names} 限速；"),
    "rights.call": ("call {names}", "调用 {names}"),
    "rights.call_and": ("call {names};", "调用 {names}；"),
    "rights.not_stop": (
        "as it seems, not stop: use the vehicle's own switch", "可能无权急停：请使用车身上的急停开关",
    ),
    # clock
    "clock.no_message": ("no message arrived", "未收到消息"),
    "clock.delay": (
        "messages take up to {spread:.2f} s longer than the fastest",
        "消息比最快的一条最多慢 {spread:.2f} s",
    ),
    "clock.behind": (
        "this laptop's clock is {offset:.1f} s behind the robot's", "本机时钟比机器人慢 {offset:.1f} s",
    ),
    "clock.ahead": (
        "this laptop's clock is {offset:.1f} s ahead of the robot's", "本机时钟比机器人快 {offset:.1f} s",
    ),
    "clock.agree": ("clocks agree to {ms:.0f} ms", "时钟偏差 {ms:.0f} ms"),
    # relay, link, streams
    "relay.lost": ("the relay is silent", "收不到中继器的数据"),
    "relay.never": ("no report of the relay received", "从未收到中继器的报告"),
    "relay.brakes": ("the relay sends BRAKE: {reason}", "中继器正在发送制动：{reason}"),
    "relay.up": (
        "the relay passes commands, up for {uptime:.0f} s", "中继器正在转发指令，已运行 {uptime:.0f} s",
    ),
    "relay.version": (
        "the relay is T2 {version}, this laptop {t2}", "中继器的版本为 T2 {version}，本机为 {t2}",
    ),
    "link.no_bridge": ("no bridge reports the board", "没有桥接服务报告主控板状态"),
    "link.no_relay": ("no frame of the board without the relay", "没有中继器，收不到主控板的数据帧"),
    "link.never": ("no frame received from the board at {board}", "从未收到主控板 {board} 的数据帧"),
    "link.lost": ("the board at {board} is silent", "主控板 {board} 无应答"),
    "link.rejects": ("the bridge rejects frames of the board: {counts}", "桥接服务拒收主控板的数据帧：{counts}"),
    "link.unsent": (
        "the system failed to send {count} datagrams to the board", "系统未能向主控板发送 {count} 个数据报",
    ),
    "link.up": ("the board at {board} is up", "主控板 {board} 在线"),
    "link.answers": (
        "the board at {board} is up, answers in {ms:.1f} ms", "主控板 {board} 在线，应答时间 {ms:.1f} ms",
    ),
    "link.not_armed": ("the bridge accepts no motion now:", "桥接服务当前不接受运动指令："),
    "streams.no_board": ("no data without the board", "没有主控板，收不到数据"),
    "streams.slow": ("{path} has {rate:.0f} of {expected:g} Hz", "{path} 为 {rate:.0f} Hz，应为 {expected:g} Hz"),
    # localization
    "map.absent": (
        "localization is not running: only driving in the map needs it",
        "定位服务未运行：仅在地图中行驶时需要",
    ),
    "map.no_pose": ("localization publishes no pose", "定位服务不发布位姿"),
    "map.fixes": (
        "{source}: {used} fixes used, {refused} refused", "{source}：已采用 {used} 次定位修正，拒绝 {refused} 次",
    ),
    "map.never": ("{source}: no fix was received", "{source}：从未收到定位修正"),
    "map.silent": ("{source}: no fix for {age:.0f} s", "{source}：已 {age:.0f} s 未收到定位修正"),
    "map.refused": (
        "{source}: {count} fixes in a row refused:", "{source}：连续 {count} 次定位修正被拒绝：",
    ),
    # patrol
    "patrol.unknown_source": (
        "safety does not obey patrol: no round can move the vehicle",
        "安全服务不执行巡逻的指令：巡逻无法移动车辆",
    ),
    # safety
    "safety.no_state": ("safety publishes no state", "安全服务不发布状态"),
    "safety.follows": ("follows from the above:", "由上述原因引起："),
    "safety.slow": ("(slow)", "（减速）"),
    "safety.slow_latched": ("(slow, latched)", "（减速，已锁定）"),
    "safety.stop": ("(stop)", "（停止）"),
    "safety.stop_latched": ("(stop, latched)", "（停止，已锁定）"),
    "safety.brake": ("(brake)", "（制动）"),
    "safety.brake_latched": ("(brake, latched)", "（制动，已锁定）"),
    # summary
    "options": ("For commands of t2 these options: {words}", "t2 命令请加以下选项：{words}"),
    "none_found": ("No problems found.", "未发现问题。"),
    "one_found": ("1 problem found.", "发现 1 个问题。"),
    "found": ("{count} problems found.", "发现 {count} 个问题。"),
}  # fmt: skip

REMEDIES: dict[str, Words] = {
    "start": catalogue.START,
    "reset": catalogue.RESET,
    "silent": catalogue.BOARD_SENDS,
    "board_lost": catalogue.BOARD_LOST,
    "socket": (
        "the router creates this file: start it, or correct bus.connect",
        "该文件由路由器创建：请启动路由器，或修改 bus.connect",
    ),
    "certificate": (
        "`t2 keys list`, where the robot's certificate authority is, shows the validity of "
        "certificates; issue or renew it there, and copy its folder here again",
        "在机器人的证书颁发机构所在计算机上运行 `t2 keys list` 可查看证书有效期；请在该处签发或更新证书，"
        "并重新复制其文件夹到此处",
    ),
    "host_name": (
        "use a numeric address, or correct bus.connect", "请使用数字地址，或修改 bus.connect",
    ),
    "refused": (
        "on the robot: is `t2 up` running? By default the router listens on its own host only; "
        "docs/security.md explains how to open it for laptops",
        "请确认机器人上 `t2 up` 正在运行。路由器默认只监听本机；向笔记本电脑开放的方法见 docs/security.md",
    ),
    "no_route": (
        "join the robot's Wi-Fi; then --set bus.connect={protocol}/ROBOT:7447 with the robot's address",
        "请连接机器人的 Wi-Fi，然后使用 --set bus.connect={protocol}/ROBOT:7447，其中 ROBOT 为机器人地址",
    ),
    "other_router": (
        "it hangs, requires TLS, or is not a router: restart it, or correct bus.connect",
        "该程序已停止响应、要求 TLS 或不是路由器：请重启，或修改 bus.connect",
    ),
    "stranger": (
        "copy members.json to the router's computer and restart the router; if `t2 keys list` shows "
        "that it is revoked, use another certificate",
        "请将 members.json 复制到路由器所在计算机并重启路由器；若 `t2 keys list` 显示证书已吊销，请使用其他证书",
    ),
    "robot": (
        "is it switched on, and its stack started? Otherwise correct --robot or robot.id",
        "请确认机器人已开机且服务已启动；否则修改 --robot 或 robot.id",
    ),
    "duplicate": (
        "stop one of them: a robot has one of each; look for a second `t2 up`",
        "请停止其中一个：每台机器人每种服务只能有一个；请查找第二个 `t2 up`",
    ),
    "no_recorder": (
        "if the robot should record, start it again: `systemctl restart t2-recorder`, or `t2 up`",
        "如需录制，请重新启动：`systemctl restart t2-recorder` 或 `t2 up`",
    ),
    "camera_twice": (
        "stop one of them, or give it another name: `t2 camera SOURCE --name NAME`",
        "请停止其中一个，或另行命名：`t2 camera SOURCE --name NAME`",
    ),
    "hangs": (
        "kill its process; its supervisor restarts it", "请终止其进程；监管程序会将其重启",
    ),
    "stalls": ("find the processes that use its CPU", "请查找占用其 CPU 的进程"),
    "update": (
        "install the same version on both, and restart the robot's services",
        "请在两边安装相同版本，并重启机器人的服务",
    ),
    "undecodable": (
        "a publisher with another version, or a foreign program", "发布者的版本不同，或为外来程序",
    ),
    "no_message": (
        "the router's access rules do not allow this laptop to read: use another certificate; "
        "if other laptops receive nothing either, all services hang: restart them",
        "路由器的访问规则不允许本机读取：请使用其他证书；若其他计算机也收不到，则所有服务已停止响应：请重启服务",
    ),
    "role": (
        "`t2 keys list`, where the certificate authority is, shows its certificate's role",
        "在证书颁发机构所在计算机上运行 `t2 keys list` 可查看其证书的角色",
    ),
    "delay": (
        "move closer to the access point; safety refuses requests with too high a delay",
        "请靠近接入点；安全服务会拒绝延迟过大的请求",
    ),
    "clock": (
        "synchronize both clocks with NTP; driving does not need it, recordings do",
        "请用 NTP 同步两边的时钟；驾驶不需要，但记录需要",
    ),
    "relay": (
        "is the relay on, its service running, and its cable to the PC connected? board.address and "
        "board.relay_port must be the relay's (docs/relay.md); without a relay set relay_port = 0",
        "请确认中继器已通电、其服务在运行、与工控机的线缆已连接；board.address 和 board.relay_port 必须为中继器的"
        "（docs/relay.md）；没有中继器时设置 relay_port = 0",
    ),
    "relay_copy": (
        "copy services/relay of this version to the relay (docs/relay.md)",
        "请将此版本的 services/relay 复制到中继器（docs/relay.md）",
    ),
    "relay.start": (
        "it waits for a neutral command: is the bridge running?",
        "正在等待零速指令：请确认桥接服务在运行",
    ),
    "relay.silent": (
        "it lost the commands of the PC: check the cable and the load of both computers",
        "收不到工控机的指令：请检查线缆和两台计算机的负载",
    ),
    "relay.hit": (
        "it waits for the bridge's answer to a bumper hit: is the bridge running?",
        "正在等待桥接服务对防撞条触发的应答：请确认桥接服务在运行",
    ),
    "link_never": (
        "is the board on, its cable connected, and this robot's address the one that it sends to "
        "(board.listen_address; 10.7.5.220 on the vehicle)?",
        "请确认主控板已通电、线缆已连接，且本机器人的地址是其发送目标（board.listen_address；车上为 10.7.5.220）",
    ),
    "frames": ("`t2 wire decode` shows the invalid frames", "`t2 wire decode` 可显示无效的数据帧"),
    "unsent": (
        "check the robot's network interface, its firewall and board.address",
        "请检查机器人的网络接口、防火墙和 board.address",
    ),
    "dropped": (
        "the network or the router drops it: move closer to the access point",
        "网络或路由器丢弃了该数据：请靠近接入点",
    ),
    "localization": (
        "`t2 up --only localization`; with systemd `systemctl start t2-localization`",
        "`t2 up --only localization`；systemd 用 `systemctl start t2-localization`",
    ),
    "place": (
        """let the vehicle stand; then `t2 call localization/place '{"x": 0.0, "y": 0.0, "heading": """
        """0.0}'`, with its position in m and its heading in rad""",
        """让车辆停稳；然后运行 `t2 call localization/place '{"x": 0.0, "y": 0.0, "heading": 0.0}'`，"""
        """填入位置（m）和航向（rad）""",
    ),
    "fixes": (
        "is its program running, and `t2 hz @cmd/fix/{source}` above 0? A source may be out of sight",
        "请确认其程序在运行，且 `t2 hz @cmd/fix/{source}` 大于 0；定位来源也可能不在视野内",
    ),
    "patrol_source": (
        "restart the stack with --config config/patrol.toml, which adds it to safety.sources",
        "请以 --config config/patrol.toml 重启服务，该文件将其加入 safety.sources",
    ),
    "by_hand": ("push the vehicle off by hand; then reset", "请用手推开车辆，然后复位"),
}  # fmt: skip

PREFIX, REMEDY = "doctor.", "remedy."
TEXTS: dict[str, Words] = {
    **catalogue.TEXTS,
    **{PREFIX + name: words for name, words in FINDINGS.items()},
    **{REMEDY + name: words for name, words in REMEDIES.items()},
    **{REMEDY + row.name: row.remedy for row in catalogue.EVENTS if row.services == "camera"},
    **{f"{REMEDY}cause.{name}": entry.remedy for name, entry in catalogue.CAUSES.items()},
}
PLACES: dict[str, Words] = {
    "network": ("network", "网络"),
    "router": ("router", "路由器"),
    "robot": ("robot", "机器人"),
    "services": ("services", "服务"),
    "versions": ("versions", "版本"),
    "rights": ("rights", "权限"),
    "clock": ("clock", "时钟"),
    "relay": ("relay", "中继器"),
    "link": ("link", "主控板"),
    "streams": ("streams", "数据流"),
    "map": ("map", "地图"),
    "patrol": ("patrol", "巡逻"),
    "camera": ("camera", "摄像头"),
    "safety": ("safety", "安全"),
}
MARKS: dict[Level, Words] = {
    "ok": ("ok", "正常"),
    "note": ("note", "提示"),
    "wrong": ("WRONG", "错误"),
    "unknown": ("?", "?"),
}


@dataclass(frozen=True, slots=True)
class Finding:
    """One check with its result and remedy."""

    where: str  # a name of PLACES
    level: Level
    name: str  # stable, for programs
    phrases: Phrases
    remedy: Phrases = ()

    def text(self, language: Language = "en") -> str:
        """Return the result as text."""
        return render(self.phrases, language, "", TEXTS)

    def todo(self, language: Language = "en") -> str:
        """Return the remedy as text, an instruction to the operator; empty without one."""
        return render(self.remedy, language, "", TEXTS)


def found(where: str, level: Level, name: str, remedy: str = "", /, **fields: Field) -> Finding:
    """Return a finding by the names of its text and its remedy, with the fields of both."""
    todo = (Phrase(REMEDY + remedy, fields),) if remedy else ()
    return Finding(where, level, name, (Phrase(PREFIX + name, fields),), todo)


def said(phrases: Phrases, text: str) -> Phrases:
    """Return the phrases of a message, or its text if this version does not know them."""
    is_known = bool(phrases) and all(phrase.name in catalogue.TEXTS for phrase in phrases)
    return phrases if is_known else (Phrase(f"{PREFIX}text", {"text": text}),)
