"""Texts of the shift log, in English and Chinese: its phrases, kinds of rows and column heads."""

from t2.messages import LogKind
from t2.patrol_texts import Words

PHRASES: dict[str, Words] = {
    "log.text": ("{text}", "{text}"),  # of an event without phrases
    "log.reset_by": ("Reset by {who:operator}.", "{who:operator} 已复位。"),
    "log.reset": ("Reset; the name is not recorded.", "已复位；未记录姓名。"),
    "log.no_reset": ("No reset is recorded.", "没有复位记录。"),
    "log.reset_refused": ("Reset refused.", "复位被拒绝。"),
    "log.asked_by": ("Asked for by {who:operator}.", "由 {who:operator} 提出。"),
    "log.unconfirmed": ("Safety did not report that.", "安全服务未报告其结果。"),
    "log.round": ("Round on {route}.", "路线 {route} 的巡逻。"),
    "log.no_end": ("Its end is not recorded.", "没有结束记录。"),
    "log.unreadable": (
        "The shift log {file} cannot be read: {reason}.",
        "无法读取值班日志 {file}：{reason}。",
    ),
    "log.unknown_robot": (
        "This dashboard does not know the robot: it was not on since the dashboard started.",
        "仪表板中没有该机器人：自仪表板启动以来该机器人未开机。",
    ),
    "log.busy": ("Too many robots are open.", "同时打开的机器人过多。"),
    "log.gap": (
        "NOT RECORDED: the recorder was off, or received nothing from safety.",
        "无记录：记录器未运行，或未收到安全服务的消息。",
    ),
}
KINDS: dict[LogKind, Words] = {
    "stop": ("stop", "停车"),
    "takeover": ("take-over", "接管"),
    "reset": ("reset", "复位"),
    "round": ("round", "巡逻"),
    "note": ("note", "备注"),
    "gap": ("gap", "缺失"),
}
HEADS: dict[str, Words] = {
    "robot": ("robot", "机器人"),
    "begin": ("begin", "开始"),
    "end": ("end", "结束"),
    "kind": ("kind", "类别"),
    "text": ("what", "内容"),
}
QUIET: Words = ("it was recording, and nothing happened", "期间有记录，没有事件发生")
