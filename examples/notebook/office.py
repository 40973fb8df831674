# %% [markdown]
# # Where should the robot drive next?
#
# A robot has driven through an office and built a pose graph: poses, and measurements between them. It shall go to a place on the other
# side. Some ways lead past places that it has seen before, and what it measures there makes its map more certain. This notebook reads
# the graph and the map, finds candidate paths, chooses the best one with a proof, and writes it to a file.

# %%
import numpy as np

import topobelief as tb

graph = tb.optimize(tb.read_g2o("../office/recorded.g2o"))
world = tb.read_ros_map("../office/recorded.yaml")
graph

# %% [markdown]
# `optimize` moves the poses to the maximum-likelihood estimate, at which entropies and bounds are meaningful. This is the graph on the
# map that the robot made with its laser:

# %%
tb.draw_graph(graph, world=world);

# %% [markdown]
# ## Candidates
#
# A roadmap of the free space, twenty diverse paths on it, and for each path the poses and loop closures that driving it would add to the
# graph.

# %%
start, goal = graph.poses[-1], (25.0, -2.95)

roadmap = tb.build_roadmap(world, start, goal)
paths = tb.diverse_paths(roadmap, start, goal, num_paths=20, max_detour=2.5)
actions = tb.predict_actions(graph, paths, world=world)
roadmap, actions[0]

# %% [markdown]
# ## The decision
#
# The planner ranks the actions by the topology of the graph that each would leave (`"resistance"`: the mean effective resistance between
# the poses that exist now) and proves which action leaves the smallest expected error of the map. It shows metres as centimetres.

# %%
planner = tb.Planner(graph, objective="error", signature="resistance")
decision = planner.decide(actions, proof="optimal", on_progress=tb.progress())
decision

# %% [markdown]
# `print(decision)` gives the same as text, `decision.to_dict()` as plain values for JSON.

# %%
print(repr(decision))
print(decision.summary())

# %% [markdown]
# The chosen path, and the poses that it sees again:

# %%
tb.draw_paths(graph, paths, actions, decision, world=world, goal=goal);

# %% [markdown]
# A candidate whose lower bound lies right of the dashed line cannot be the best, and was not evaluated. For the picture the exact values of
# all are computed.

# %%
tb.draw_bounds(decision, planner.entropies(actions));

# %% [markdown]
# ## The path for the robot
#
# x, y and yaw at each waypoint, in the frame of the graph:

# %%
path = tb.path_poses(paths[decision.best])
np.savetxt("path.csv", path, fmt="%.3f", delimiter=",", header="x,y,yaw", comments="")
print(path.round(2))
