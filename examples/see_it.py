"""See a run: the arm in three dimensions, its curves, and how near it came to its limits."""

import fpid_pin as fp

arm = fp.Arm.from_example("panda")
reference = fp.references.ToolCircle(arm, radius=0.08, period=4.0, ramp=1.0)  # [m], [s]
experiment = fp.Experiment(arm, reference, duration=8.0)
run = fp.simulate(experiment, fp.suggest_gains(arm, feedforward=True, observer="suggested"))

fp.view.export_html(run, "circle.html")  # one file, for any browser
for name, figure in fp.view.figures(run).items():
    fp.view.save_figure(figure, f"circle-{name}.svg")
print(run)
print(f"the tool was at most {1e6 * run.tool_error.max():.1f} um away")
passed = fp.simulation.limit_report(run)
print("limits passed:", ", ".join(map(str, passed)) or "none")
