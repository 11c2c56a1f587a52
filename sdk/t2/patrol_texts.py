"""Texts of patrol, in English and Chinese: part of the catalogue."""

Words = tuple[str, str]  # English, Chinese

PHRASES: dict[str, Words] = {
    # what a round does
    "patrol.idle": ("No round is driven.", "当前没有巡逻。"),
    "patrol.announcing": (
        "Announcing the round on {route}: the vehicle is about to move.",
        "正在预告路线 {route} 的巡逻：车辆即将移动。",
    ),
    "patrol.driving": (
        "Driving {route}; the next station is {station}.", "正在行驶路线 {route}；下一站：{station}。",
    ),
    "patrol.returning": (
        "Driving home along {route}, in the opposite direction.", "正沿路线 {route} 反向返回起点。",
    ),
    "patrol.staying": ("Staying at {station}.", "正在 {station} 停留。"),
    "patrol.waiting": (
        "Waiting: it goes on by itself when the way is free.", "等待中：通道畅通后自动继续。",
    ),
    "patrol.blocked": (
        "Blocked for {seconds:.0f} s: free the way, or return home.",
        "已受阻 {seconds:.0f} s：请清空通道，或返回起点。",
    ),
    "patrol.paused": (
        "Paused: resume the round to go on.", "已暂停：请选择“继续”。",
    ),
    "patrol.overruled": (
        "Paused: {source:source} has taken control. Resume the round to go on.",
        "已暂停：{source:source}取得控制权。如需继续巡逻，请选择“继续”。",
    ),
    "patrol.home": ("The round is complete, and the vehicle is at home.", "巡逻完成，车辆已回到起点。"),
    "patrol.returned": (
        "The vehicle has returned home before the end of the round.",
        "车辆未完成巡逻，已返回起点。",
    ),
    "patrol.aborted": (
        "The round was aborted: drive the vehicle home.", "巡逻已中止：请将车辆驾驶回起点。",
    ),
    "patrol.resume": (
        "When the cause is fixed, resume the round.", "原因排除后，请选择“继续”。",
    ),
    # why a round stops, or cannot go on
    "patrol.latched": (
        "A reset is needed: {causes:word}. Look at the vehicle, then reset.",
        "须复位：{causes:word}。请查看车辆，然后复位。",
    ),
    "patrol.forbidden": (
        "Safety forbids every motion: {causes:word}. See `t2 doctor`.",
        "安全服务禁止一切行驶：{causes:word}。请查看 `t2 doctor`。",
    ),
    "patrol.safety_silent": ("Safety is silent.", "收不到安全服务的消息。"),
    "patrol.safety_restarted": ("Safety has restarted.", "安全服务已重启。"),
    "patrol.map_silent": (
        "The pose in the map is not received: is the board connected, and localization running?",
        "收不到地图中的位姿：主控板是否已连接？定位服务是否在运行？",
    ),
    "patrol.map_restarted": (
        "Localization has restarted: place the vehicle.", "定位服务已重启：请设定车辆位置。",
    ),
    "patrol.placed": (
        "The vehicle was placed anew during the round.", "巡逻期间车辆位置被重新设定。",
    ),
    "patrol.twice": (
        "Another patrol service runs for this robot: end one of them.",
        "该机器人有另一个巡逻服务正在运行：请停止其中一个。",
    ),
    "patrol.held_up": (
        "Patrol was held up for {seconds:.1f} s: the computer slept, or was overloaded.",
        "巡逻服务停顿了 {seconds:.1f} s：计算机曾休眠或过载。",
    ),
    "patrol.outside": (
        "The vehicle is {deviation:.2f} m from the route; the corridor is {corridor:.2f} m. Drive it "
        "back to the route.",
        "车辆偏离路线 {deviation:.2f} m，通道半宽为 {corridor:.2f} m。请将车辆驾驶回路线。",
    ),
    "patrol.uncertain": (
        "The position is too uncertain: {deviation:.2f} m from the route and twice {sigma:.2f} m are "
        "more than the corridor of {corridor:.2f} m. Place the vehicle at a station, or wait for "
        "fixes.",
        "位置不确定度过大：偏离路线 {deviation:.2f} m 加两倍 {sigma:.2f} m 超出通道半宽 "
        "{corridor:.2f} m。请在某一站设定车辆位置，或等待定位修正。",
    ),
    "patrol.unheard": (
        "Safety does not obey patrol: add it to safety.sources (--config config/patrol.toml), and see "
        "`t2 doctor`.",
        "安全服务不执行巡逻的指令：请将 patrol 加入 safety.sources（--config config/patrol.toml），并查看 `t2 doctor`。",
    ),
    "patrol.stuck": (
        "The vehicle does not move although the way is free, for {seconds:.0f} s: look for a "
        "threshold or a cable under it.",
        "通道畅通，但车辆 {seconds:.0f} s 未移动：请检查车下是否有门槛或线缆。",
    ),
    "patrol.frozen": (
        "The position does not change although the vehicle drives, for {distance:.1f} m: it hangs, or "
        "the position is frozen.",
        "车辆行驶 {distance:.1f} m，位置没有变化：车辆被卡住，或位置数据停滞。",
    ),
    "patrol.blocked_stop": (
        "Blocked for {seconds:.0f} s, and the route says to stop then.",
        "已受阻 {seconds:.0f} s，按路线设置停止。",
    ),
    "patrol.restarted": (
        "Patrol has restarted during the round.", "巡逻期间巡逻服务已重启。",
    ),
    # answers and refusals
    "patrol.started": ("The round {round} on {route} begins.", "路线 {route} 的巡逻 {round} 开始。"),
    "patrol.done": ("Done.", "完成。"),
    "patrol.not_now": (
        "{action:word}: not possible now. {state:word} allows: {actions:word}.",
        "当前无法执行“{action:word}”。“{state:word}”状态下可用：{actions:word}。",
    ),
    "patrol.no_name": ("Name a route.", "请指定路线名称。"),
    "patrol.busy": (
        "A round on {route} is not over: resume or abort it first.",
        "路线 {route} 的巡逻尚未结束：请先继续或中止。",
    ),
    "patrol.teaching": (
        "The route {route} is being taught: end or cancel that first.",
        "正在示教路线 {route}：请先结束或取消。",
    ),
    "patrol.other_robot": (
        "The route {route} is of robot {other}, and this is {robot}. If both have the same map, set "
        "robot in its file.",
        "路线 {route} 属于机器人 {other}，本机为 {robot}。若两者使用同一地图，请修改其文件中的 robot。",
    ),
    "patrol.not_home": (
        "The vehicle is {distance:.2f} m from home, the first station of {route}, and {corridor:.2f} m "
        "are allowed: drive it there.",
        "车辆距路线 {route} 的起点（第一站）{distance:.2f} m，允许 {corridor:.2f} m：请将其驾驶到起点。",
    ),
    "patrol.other_drives": (
        "{source:source} is in control: let go of the controls.",
        "由{source:source}控制：请松开操纵装置。",
    ),
    "patrol.disk": (
        "{folder} cannot be written ({reason}): free disk space, or check its permissions.",
        "无法写入 {folder}（{reason}）：请释放磁盘空间，或检查其权限。",
    ),
    "patrol.no_round": ("There is no round {round} in the ledger.", "台账中没有巡逻 {round}。"),
    # stations and schedule
    "patrol.station": ("Arrived at {station}.", "已到达 {station}。"),
    "patrol.skipped": (
        "The scheduled round {schedule} on {route} is skipped:", "跳过定时巡逻 {schedule}（路线 {route}）：",
    ),
    "patrol.late": (
        "its start is {seconds:.0f} s past; the computer was off or asleep, or its clock was set.",
        "已超过开始时间 {seconds:.0f} s；计算机曾关机或休眠，或时钟被调整。",
    ),
    "patrol.unwritten": (
        "The ledger cannot be written ({reason}); {count} rounds wait for it.",
        "无法写入台账（{reason}）；有 {count} 次巡逻等待写入。",
    ),
    # teaching
    "teach.begun": (
        "Teaching {route}: drive it forward, and mark stations.", "正在示教 {route}：请前进行驶，并标记站点。",
    ),
    "teach.station": ("Station {station} at {length:.1f} m.", "站点 {station} 位于 {length:.1f} m 处。"),
    "teach.ended": (
        "The route {route} is saved: {length:.1f} m, {count} stations.",
        "路线 {route} 已保存：{length:.1f} m，{count} 个站点。",
    ),
    "teach.loop": ("It is a loop: a round ends where it begins.", "该路线为环线：巡逻在起点结束。"),
    "teach.open": (
        "It ends {distance:.1f} m from home, so a round drives back along it; a loop ends within "
        "{closing:.1f} m.",
        "终点距起点 {distance:.1f} m，巡逻将沿原路返回；终点距起点 {closing:.1f} m 以内时为环线。",
    ),
    "teach.cancelled": ("Teaching of {route} is cancelled.", "已取消示教 {route}。"),
    "teach.saved": ("The route {route} is saved.", "路线 {route} 已保存。"),
    "teach.deleted": ("The route {route} is deleted.", "路线 {route} 已删除。"),
    "teach.exists": (
        "The route {route} exists: delete it first, or choose another name.",
        "路线 {route} 已存在：请先删除，或使用其他名称。",
    ),
    "teach.none": ("No route is being taught.", "当前没有示教。"),
    "teach.no_station": ("Name the station.", "请指定站点名称。"),
    "teach.station_twice": ("There is a station {station} already.", "站点 {station} 已存在。"),
    "teach.short": (
        "The route is {length:.2f} m long; it needs {least:.2f} m.",
        "路线长 {length:.2f} m，至少需要 {least:.2f} m。",
    ),
    "teach.driven": (
        "A round on {route} is not over: end it before its route changes.",
        "路线 {route} 的巡逻尚未结束：请先结束，再修改路线。",
    ),
    # why nothing more of a route is recorded
    "teach.ends_here": (
        "Nothing is recorded from {length:.1f} m on: end to keep the part before, or cancel.",
        "自 {length:.1f} m 起不再记录：结束可保留此前部分，也可取消。",
    ),
    "teach.lost": ("The position in the map is not known.", "地图中的位置未知。"),
    "teach.uncertain": (
        "The position is known to {sigma:.2f} m only (standard deviation); a corridor of "
        "{corridor:.2f} m needs half of that at most.",
        "位置标准差为 {sigma:.2f} m；通道半宽 {corridor:.2f} m 要求标准差不超过其一半。",
    ),
    "teach.backward": (
        "The vehicle was driven backward, and a round drives forward only.",
        "车辆曾后退行驶，而巡逻只能前进。",
    ),
    "teach.jump": (
        "The position has jumped by {distance:.2f} m.", "位置跳变了 {distance:.2f} m。",
    ),
    "teach.restarted": ("Patrol has restarted.", "巡逻服务已重启。"),
    "teach.full": ("The route has {points} points, which is the limit.", "路线已有 {points} 个点，达到上限。"),
    # problems of a route's file
    "route.none": ("There is no route {route}.", "没有路线 {route}。"),
    "route.unreadable": ("{file}: {reason}.", "文件 {file} 有误：{reason}。"),
    "route.name": (
        "{file} has the name {route}: rename one of both.", "{file} 中的名称为 {route}：请统一二者。",
    ),
    "route.no_home": (
        "The first point needs a station: home.", "第一个点需要站点名称：起点。",
    ),
    "route.station_twice": (
        "The station {station} is there twice: points {first} and {second}.",
        "站点 {station} 重复：第 {first} 和第 {second} 个点。",
    ),
    "route.gap": (
        "Points {first} and {second} are {distance:.0f} m apart, {most:.0f} m are allowed: is it a "
        "typing error?",
        "第 {first} 和第 {second} 个点相距 {distance:.0f} m，允许 {most:.0f} m：是否输入有误？",
    ),
}  # fmt: skip

# States of a round, for ``{state:word}``.
STATES: dict[str, Words] = {
    "idle": ("idle", "空闲"),
    "announcing": ("announcing", "预告中"),
    "driving": ("driving", "行驶中"),
    "staying": ("staying", "停留中"),
    "waiting": ("waiting", "等待中"),
    "paused": ("paused", "已暂停"),
    "returning": ("returning", "返回中"),
    "stopped": ("stopped", "已停止"),
    "done": ("done", "已结束"),
}

# What is asked of patrol, for ``{action:word}``.
ACTIONS: dict[str, Words] = {
    "start": ("start", "开始"),
    "depart": ("depart", "立即出发"),
    "pause": ("pause", "暂停"),
    "resume": ("resume", "继续"),
    "return": ("return", "返回起点"),
    "abort": ("abort", "中止"),
    "teach_begin": ("begin to teach", "开始示教"),
    "teach_station": ("mark a station", "标记站点"),
    "teach_end": ("end teaching", "结束示教"),
    "teach_cancel": ("cancel teaching", "取消示教"),
}
