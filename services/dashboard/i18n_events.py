"""Events and results of calls by name, in English and Chinese; part of the catalogue ``i18n``.

An event is looked up as ``event.SERVICE.NAME``, then as ``event.NAME``. In English the page shows
the event's own text, which carries the figures. In Chinese it shows the entry and that text below.
"""

EVENTS: dict[str, tuple[str, str]] = {
    # --- bridge -------------------------------------------------------------------------------
    "event.link_up": ("The link to the board is up.", "与主板的连接已建立。"),
    "event.link_lost": (
        "The link to the board is lost; STOP is being sent.",
        "与主板的连接已断开，正在发送停止指令。",
    ),
    "event.port_changed": (
        "Frames of one kind have changed their UDP port.", "某类帧改用了另一个 UDP 端口。"),
    "event.board_restarted": (
        "The board has restarted; its brakes are set again.", "主板已重启，正在重新设置紧急制动。"),
    "event.switches_unverified": (
        "The board does not confirm its emergency brakes.", "主板未确认紧急制动已开启。"),
    "event.bridge.contact": (
        "The bumper was hit; BRAKE was sent at once.", "防撞条被碰撞，已立即发送制动指令。"),
    "event.driver_fault": (
        "The faults of a motor driver have changed.", "电机驱动器的故障状态发生变化。"),
    "event.second_authority": (
        "A motion from another program than safety was refused.",
        "已拒绝安全服务以外的程序发送的运动指令。",
    ),
    "event.seq_jump": (
        "A motion with a jump in its sequence number was refused.",
        "已拒绝序号跳变的运动指令。",
    ),
    "event.bridge.uncommanded_motion": (
        "The vehicle moved without safety; BRAKE is being sent.",
        "安全服务未运行时车辆发生移动，正在发送制动指令。",
    ),
    "event.guard_gone": (
        "The guard process has ended; the bridge stops the vehicle and ends.",
        "守护进程已终止，桥接服务将停车并退出。",
    ),
    "event.drive_link_up": ("The drive link is back.", "运动指令链路已恢复。"),
    "event.drive_link_lost": ("The drive link is lost.", "运动指令链路已断开。"),
    # --- safety -------------------------------------------------------------------------------
    "event.contact": ("The bumper was hit.", "防撞条被碰撞，已锁定。"),
    "event.estop": ("Emergency stop.", "急停，已锁定。"),
    "event.estop_reader": (
        "Emergency stops could not be received.", "无法接收急停信号，已锁定。"),
    "event.predecessor": (
        "Safety has restarted with a reset still due.", "安全服务已重启，仍需复位。"),
    "event.runaway": ("The vehicle did not move as commanded.", "车辆未按指令运动，已锁定。"),
    "event.uncommanded_motion": (
        "The vehicle moved while standstill was commanded.",
        "停止指令期间车辆发生移动，已锁定。",
    ),
    "event.not_stopping": ("The vehicle does not stop.", "车辆未能停住，已锁定。"),
    "event.safety.driver_fault": (
        "A motor driver reports a fault.", "电机驱动器报告故障，已锁定。"),
    "event.flapping": ("Inputs have failed repeatedly.", "输入信号反复失效，已锁定。"),
    "event.stop": ("The vehicle has stopped.", "车辆已停止。"),
    "event.source": ("The driving source has changed.", "驾驶来源已切换。"),
    "event.release": (
        "An operator moves the vehicle off the bumper.", "操作员正在使车辆缓慢脱离碰撞。"),
    "event.release_end": ("The release has ended.", "脱离碰撞操作已结束。"),
    "event.release_refused": ("The release was refused.", "脱离碰撞请求被拒绝。"),
    "event.reset": ("The named causes are reset.", "指定的原因已复位。"),
    "event.reset_refused": ("The reset was refused.", "复位请求被拒绝。"),
    # --- odom ---------------------------------------------------------------------------------
    "event.reanchored": (
        "Odometry continues after a restart of board or bridge.",
        "主板或桥接服务重启后，里程计已无跳变地继续。",
    ),
    "event.pose_set": ("The pose was set.", "位姿已设置。"),
    "event.silent": (
        "Odometry receives no counters and no velocities.", "里程计未收到编码器计数和速度。"),
    "event.heard": (
        "Odometry receives counters and velocities again.", "里程计已恢复接收编码器计数和速度。"),
    "event.slip": ("Counters and velocities disagree.", "编码器计数与速度不一致，车轮可能打滑。"),
    "event.slip_over": ("Counters and velocities agree again.", "编码器计数与速度已恢复一致。"),
    # --- teleop -------------------------------------------------------------------------------
    "event.gamepad": ("A gamepad was connected or disconnected.", "手柄已连接或断开。"),
    "event.unheard": (
        "Teleop receives no state of safety; its controls are released.",
        "遥控终端未收到安全服务状态，已松开操纵装置。",
    ),
    "event.teleop.estop": (
        "The operator at the terminal has requested an emergency stop.", "终端操作员请求急停。"),
    "event.estop_unconfirmed": (
        "EMERGENCY STOP NOT CONFIRMED: use the vehicle's own switch!",
        "急停未被确认：请使用车身上的急停开关！",
    ),
    "event.reset_unconfirmed": (
        "RESET NOT CONFIRMED by safety's state.", "复位未被安全服务的状态确认。"),
    "event.terminal_slow": (
        "The terminal is too slow; its keys are ignored.", "终端响应过慢，按键已被忽略。"),
    "event.gamepad_silent": (
        "The gamepad sent no event and was released.", "手柄长时间无事件，已视为松开。"),
    "event.barred": (
        "The router drops the drive requests; this certificate may only watch.",
        "路由器丢弃了行驶请求，该证书只能观看。",
    ),
    # --- recorder -----------------------------------------------------------------------------
    "event.black_box": ("A black box recording was written.", "黑匣子记录已保存。"),
    "event.black_box_lost": (
        "No disk space for a black box recording.", "磁盘空间不足，黑匣子记录未能保存。"),
    "event.disk_full": (
        "The disk is full or failed; recording has stopped.", "磁盘已满或出错，记录已停止。"),
    "event.recordings_removed": (
        "The oldest recordings were removed for disk space.", "磁盘空间不足，已删除最旧的记录。"),
    "event.disk_room": (
        "Disk space is available again; recording continues.", "磁盘空间已恢复，继续记录。"),
    # --- results of calls from the page -------------------------------------------------------
    "event.reset_done": ("The reset is confirmed.", "复位已确认。"),
    "event.release_held": ("Moving off the bumper.", "正在缓慢脱离碰撞。"),
    "event.call_refused": ("The command was refused.", "指令被拒绝。"),
}  # fmt: skip
