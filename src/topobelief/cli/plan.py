"""`topobelief plan`: a pose graph, a map and a goal in; the best path out, with what another could gain."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path
from typing import cast

import typer

from topobelief.cli import plan_mode, world_options
from topobelief.cli import plan_options as options
from topobelief.cli.reading import Component, Drop, Edge2OrderOption, Planar, RobustAsPlain, Topic, reading_options
from topobelief.errors import NotOptimizedWarning


def plan(
    context: typer.Context,
    graph_file: world_options.GraphFile,
    goal: world_options.Goals = None,
    start: world_options.Start = None,
    map_file: world_options.MapFile = None,
    map_topic: world_options.MapTopic = None,
    along_trajectory: world_options.AlongTrajectory = False,
    width: world_options.Width = None,
    unknown: world_options.UnknownCells = "occupied",
    flying: world_options.Flying = None,
    height: world_options.Height = None,
    resolution: world_options.Resolution = None,
    origin: world_options.Origin = None,
    robot_radius: world_options.RobotRadius = 0.35,
    path: options.PathFiles = None,
    candidates: options.NumCandidates = None,
    max_detour: options.MaxDetour = None,
    max_length: options.MaxLength = None,
    return_to_start: options.Return = False,
    enough: options.Enough = None,
    vertices: options.Vertices = 1000,
    seed: options.Seed = 0,
    spacing: options.Spacing = None,
    attitude: options.AttitudeName = None,
    closures: options.ClosuresName = None,
    closure_radius: options.ClosureRadius = None,
    closure_angle: options.ClosureAngle = None,
    min_index_gap: options.MinIndexGap = None,
    observation_range: options.ObservationRange = None,
    field_of_view: options.FieldOfView = None,
    observation_cap: options.ObservationCap = None,
    observation_chance: options.ObservationChance = None,
    line_of_sight: options.LineOfSight = None,
    sigma_p: options.SigmaP = None,
    sigma_theta: options.SigmaTheta = None,
    objective: options.Objective = None,
    signature: options.Signature = None,
    cost_per_metre: options.CostPerMetre = 0.0,
    as_paper: options.AsPaper = False,
    normalized: options.Normalized = False,
    allow_dense_spectrum: options.AllowDenseSpectrum = False,
    margin: options.Margin = None,
    deadline: options.Deadline = None,
    bounds: options.BoundsName = None,
    determinant: options.DeterminantName = "cholesky",
    proof: options.ProofName = None,
    max_evaluations: options.MaxEvaluations = None,
    optimize: world_options.Optimize = True,
    exact: options.Exact = True,
    why: options.Why = None,
    out: options.Out = None,
    write_path: options.WritePath = None,
    as_json: options.AsJson = False,
    drop: Drop = None,
    robust_as_plain: RobustAsPlain = False,
    edge2_order: Edge2OrderOption = "toro",
    component: Component = "all",
    planar: Planar = False,
    topic: Topic = None,
) -> None:
    """Choose the best way to a goal on a pose-graph map, or the best trip to improve the map.

    Searches a roadmap for the way after which the map is known best, and says how much better any other could be.
    """
    mode = plan_mode.choose(context.params)
    from topobelief.cli.console import Reporter

    reporter = Reporter(as_json=as_json)
    with reporter.stage("start-up"):
        from topobelief.candidates.closure_rate import rate_warning
        from topobelief.candidates.predicted_factors import KEY_POSE_TURN, usual_spacing
        from topobelief.candidates.propose import CandidateRule
        from topobelief.cli import (
            plan_candidates,
            plan_certificate,
            plan_draws,
            plan_ends,
            plan_errors,
            plan_files,
            plan_reasons,
            plan_search,
            plan_stages,
            plan_world,
        )
        from topobelief.cli.closure_options import stated_closures, told_closures, told_observations
        from topobelief.planning.planner import Planner
        from topobelief.planning.registry import default_signature

    choice = plan_world.WorldChoice(
        map_file,
        along_trajectory,
        width,
        unknown,
        flying,
        height,
        resolution,
        cast("tuple[float, ...] | None", origin),
        map_topic,
    )
    choice.check()
    folder = plan_files.checked_folder(out if out is not None or as_json else Path("out"))
    path_file = plan_files.checked_path_file(write_path)
    limit = max_detour if max_detour is not None else math.inf if as_paper else 1.3
    objective = objective or ("joint" if as_paper else "error")
    signature = signature or default_signature(objective)
    bounds = bounds or ("fischer" if as_paper else "auto")
    proof = proof or ("bounded" if as_paper or margin is not None else "optimal")
    rule = CandidateRule(
        num_paths=candidates or 20,
        max_detour=limit if math.isfinite(limit) else None,
        num_vertices=vertices,
        robot_radius=robot_radius,
        seed=seed,
        spacing=spacing or 1.0,
        turn=None if as_paper else KEY_POSE_TURN,
        closures=stated_closures(
            closures,
            paper=as_paper,
            closure_radius=closure_radius,
            closure_angle=closure_angle,
            min_index_gap=min_index_gap,
        ),
        line_of_sight=line_of_sight if line_of_sight is not None else not as_paper,
        information=plan_stages.information(sigma_p, sigma_theta),
        attitude=attitude,
    )
    reading = reading_options(
        drop, robust_as_plain=robust_as_plain, edge2_order=edge2_order, component=component, planar=planar, topic=topic
    )
    graph = plan_stages.read_graph(
        graph_file,
        reporter,
        optimized=optimize,
        reading=reading,
        accepted=lambda filed: choice.accepted(graph_file, filed, reporter),
    )
    world = plan_world.read_world(choice, graph, reporter)
    begin = plan_ends.choose_start(graph, world, reporter, start)
    goals = plan_ends.choose_goals(graph, goal or ())
    model = told_closures(rule.closures, graph, world, reporter, line_of_sight=rule.line_of_sight)
    rule = replace(
        rule,
        closures=model,
        observations=told_observations(
            graph,
            world,
            reporter,
            line_of_sight=rule.line_of_sight,
            max_range=observation_range,
            field_of_view=field_of_view,
            max_per_pose=observation_cap,
            probability=observation_chance,
        ),
        information=plan_stages.information(sigma_p, sigma_theta, tangent_dim=graph.tangent_dim),
        spacing=spacing or usual_spacing(graph),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotOptimizedWarning)  # `read_graph` has told
        planner = Planner(
            graph,
            objective=objective,
            signature=signature,
            bounds=bounds,
            determinant=determinant,
            normalized=normalized,
            allow_dense_spectrum=allow_dense_spectrum,
            engine="incremental" if mode.searches else "auto",
        )
    if mode.note:
        reporter.note(mode.note)
    searched: plan_search.Searched | None = None
    limits = plan_search.Limits(
        max_length=max_length,
        return_to_start=return_to_start,
        seconds=plan_mode.SECONDS if deadline is None and max_evaluations is None else deadline,
        max_evaluations=max_evaluations,
        cost_per_metre=cost_per_metre,
        enough=enough,
    )
    if mode.searches:
        searched = plan_search.search(planner, world, begin, goals, rule, limits, reporter)
        found = searched.proposals
    else:
        found = plan_candidates.find_proposals(
            graph, world, begin, goals, path or (), rule, reporter, cost_per_metre=cost_per_metre
        )
    if warning := rate_warning(graph, model, found.actions):
        reporter.note(warning)
    with reporter.stage("decision") as update:
        decision = (
            plan_search.decide(planner, searched)
            if searched is not None
            else planner.decide(
                found.actions,
                margin=margin,
                proof=proof,
                max_evaluations=max_evaluations,
                deadline=deadline,
                on_progress=lambda _, done, total: update(done, total),
            )
        )
    explained = plan_reasons.asked_for(decision, why or ())
    errors = plan_errors.expected(graph, found, decision, reporter)
    reasons = plan_reasons.reasons(graph, begin, found, decision, errors, searched=mode.searches)
    if searched is not None:
        plan_certificate.say_search(searched, decision, errors, goals, limits, reporter)
    else:
        answer = plan_errors.answer(found, decision, errors, goals)
        plan_stages.say_decision(decision, answer, rule, reporter, along_trajectory=along_trajectory)

    def detailed(index: int) -> list[str]:
        return plan_reasons.details(graph, begin, found, decision, index, reporter, searched=mode.searches)

    plan_reasons.say(reasons, decision, explained, detailed, reporter)
    spreads = plan_draws.spreads(planner, found, decision, errors.shortest_path, reporter, seed=seed)
    entropies = plan_stages.exact_entropies(planner, found.actions, decision, reporter, wanted=exact and folder is not None)
    result = plan_files.PlanResult(
        graph=graph,
        world=world,
        start=begin,
        goals=goals,
        proposals=found,
        decision=decision,
        entropies=entropies,
        errors=errors,
        reasons=reasons,
        spreads=spreads,
        rule=rule,
        options=context.params | {"objective": objective, "signature": signature, "bounds": bounds, "proof": proof},
        notes=reporter.notes,
        searched=searched,
        limits=limits,
    )
    plan_files.write(folder, path_file, result, reporter)
    reporter.answer(plan_files.document(result))
