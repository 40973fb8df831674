"""Active SLAM in closed loop: a robot with wheels and a laser, scan matching, a back end, and the planner's decisions."""
