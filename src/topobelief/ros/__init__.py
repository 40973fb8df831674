"""A ROS 2 node: map, pose graph and goal in; the way to drive, the other ways and why out.

Nothing but `node` imports rclpy, which comes with the user's ROS 2.
"""
