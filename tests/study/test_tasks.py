"""A task's id says all that its result depends on, and nothing else."""

from __future__ import annotations

import pickle


def test_every_combination_is_a_task_of_its_own(make_tasks):
    tasks = make_tasks()
    assert len(tasks) == 2 * 2 * 2 * 3
    assert len({task.id for task in tasks}) == len(tasks)
    assert [task.seed for task in tasks] == sorted(task.seed for task in tasks)


def test_a_study_that_grows_keeps_its_tasks(make_tasks):
    before = {task.id for task in make_tasks()}
    after = {task.id for task in make_tasks(seeds="[7, 2, 1, 0]", strategies="[shortest, random, spanning_trees]")}
    assert before < after


def test_what_a_result_depends_on_changes_the_id(make_tasks, specification_file):
    before = {task.id for task in make_tasks()}
    for name, value in (("rule", "{num_vertices: 121}"), ("back", "{start: [1, 1], goals: [[11, 11], [1, 8.5]]}")):
        changed = make_tasks(**{name: value})
        touched = [task for task in changed if name in ("rule", task.session.name)]
        assert touched
        assert before.isdisjoint(task.id for task in touched)
    walls = specification_file.with_name("room.csv")
    walls.write_text(walls.read_text().replace("3,3,7,7", "3,3,7,7.01"))
    assert before.isdisjoint(task.id for task in make_tasks())


def test_random_numbers_are_those_of_the_task(make_tasks):
    tasks = make_tasks()
    draws = [task.rng.random() for task in tasks]
    assert len(set(draws)) == len(draws)
    again = pickle.loads(pickle.dumps(tasks[5]))
    assert (again.id, again.rng.random()) == (tasks[5].id, draws[5])


def test_a_place_is_shared_by_what_differs_in_the_decision_alone(make_tasks):
    tasks = make_tasks()
    places = {task.session.name: {other.place for other in tasks if other.session.name == task.session.name} for task in tasks}
    assert [len(of_session) for of_session in places.values()] == [1, 1]
    assert len(set.union(*places.values())) == 2
