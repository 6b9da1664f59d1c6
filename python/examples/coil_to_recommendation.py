# %% [markdown]
# # From a coil to the next one
#
# First the design: a coil, its classic windings, a search, a proof and a recommendation. Then the measurement: a record of a coil
# that was built, what the model lacks, and the next winding. Everything here is also the command line's; the numbers are the same.

# %%
from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import coilwright as cw

print("coilwright", cw.__version__)

# %% [markdown]
# ## A coil
#
# A model is what a model file states. It is read from a file, made of keyword arguments, or copied with changes; units are in the names.

# %%
examples = next(p for p in (Path("examples"), *(q / "examples" for q in Path.cwd().parents)) if (p / "paper-200m.toml").is_file())
coil = cw.Model(
    name="a coil of 12 layers",
    refractive_index=1.45,
    thermo_optic_per_k=1.0e-5,
    wavelength_nm=1550.0,
    outer_diameter_um=165.0,
    layers=12,
    turns_per_layer=50,
    inner_diameter_mm=80.0,
    layer_length="equal",
    pattern="qua",
    thermal_model="pack",
    conductivity_w_per_m_k=0.35,
    volumetric_heat_capacity_j_per_m3_k=1.70e6,
    effects=[{"kind": "surface_film", "film_w_per_m2_k": 15.0}],
    location="ambient",
    profiles={"max_rate_c_per_h": 60.0, "count": 12, "segments": 3, "duration_s": 3600.0, "seed": 1},
)
coil

# %% [markdown]
# ## What its layers do
#
# The air ramps; heat goes in from the outside. It is not the temperature but its rate, and how it differs between mirrored pieces of
# fibre, that looks like a rotation.

# %%
field = cw.temperatures(coil, rows=300)
fig, axes = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
cw.plot_field(field, ax=axes[0])
cw.plot_field(field, ax=axes[1], from_mean=True)
plt.show()

# %% [markdown]
# ## The classic windings

# %%
classics = cw.evaluate(coil)
classics

# %%
cw.plot_patterns(classics)
plt.show()

# %% [markdown]
# ## A search
#
# Which segment of the fibre lies in which layer? What a winding shop can make with two reels is the class `standard`; `any` allows
# every permutation, for comparison.

# %%
found = cw.optimise(coil, seed=1, windability="standard")
print(found.statement)
found

# %%
fig, axes = plt.subplots(1, 2, figsize=(9, 5), layout="constrained")
cw.plot_cross_section(cw.classic("qua", coil.layers), ax=axes[0])
cw.plot_cross_section(found.pattern, ax=axes[1])
plt.show()

# %% [markdown]
# ## A proof
#
# A search can be lucky; a proof says that nothing of the class is better.

# %%
proof = cw.exact(coil, windability="standard", budget_s=60)
print(f"{proof.proof.status}: no winding is below {proof.proof.lower_bound_deg_per_h:.6f} °/h")
assert proof.proof.status == "optimal"
assert found.best.worst_rate_deg_per_h <= proof.best.worst_rate_deg_per_h * (1 + 1e-6)

# %% [markdown]
# ## What to wind
#
# The recommendation was judged on profiles that were not searched.

# %%
assert found.recommendation is not None
print(found.recommendation.sentence)
for reason in found.recommendation.reasons:
    print(" -", reason)
schedule = cw.schedule(coil, found.recommended)
assert cw.verify(coil, schedule)
schedule.to_pandas()[["step", "layer", "half", "segment", "supply_reel", "direction", "turns", "length_m"]]

# %% [markdown]
# ## A record
#
# Another coil was built and measured in a chamber. Its model takes heat to go into a half space, as the paper of 1998 did.

# %%
chamber = cw.Model.read(examples / "chamber-coil.toml")
day_1, day_2 = (cw.Record.read(examples / f"chamber-day-{day}.csv") for day in (1, 2))
comparison = cw.compare(chamber, [day_1, day_2])
fig, axes = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
cw.plot_record(day_1, ax=axes[0])
cw.plot_comparison(comparison, ax=axes[1])
plt.show()
comparison

# %% [markdown]
# ## What the model lacks

# %%
diagnosis = cw.diagnose(chamber, day_1, holdout=day_2)
print(diagnosis.verdict, [effect.kind for effect in diagnosis.effects])
cw.plot_diagnosis(diagnosis)
plt.show()
diagnosis

# %% [markdown]
# ## The extended model

# %%
extended = diagnosis.extended
assert extended is not None
after = cw.compare(extended, [day_1, day_2])
fig, axes = plt.subplots(1, 2, figsize=(11, 4), layout="constrained", sharey=True)
cw.plot_comparison(comparison, ax=axes[0], record=1)
cw.plot_comparison(after, ax=axes[1], record=1)
axes[0].set_title("day 2, which was not fitted: as declared")
axes[1].set_title("day 2: extended")
plt.show()
before_deg_per_h, after_deg_per_h = (c.records[1].rmse_deg_per_h for c in (comparison, after))
print(f"error on day 2: {before_deg_per_h:.4f} -> {after_deg_per_h:.4f} °/h")
assert after_deg_per_h < before_deg_per_h

# %% [markdown]
# ## The next winding, under the model that the records speak for

# %%
next_coil = cw.optimise(extended, compare_with="zyl", rounds=2, moves_per_restart=4000)
print(next_coil.compared_with.statement)
cw.plot_patterns(next_coil)
plt.show()
next_coil.recommended

# %% [markdown]
# ## A cost of one's own
#
# What finite elements computed is a field of arrays; so is a matrix of sensitivities; and any function of the pattern can be searched.

# %%
own_field = cw.Field(time_s=field.time_s, temperature_c=field.temperature_c, name="computed elsewhere")
under_field = cw.search_field(coil, own_field, windability="standard")
sensitivities, constant = cw.sensitivities(coil, own_field)
of_array = cw.search_matrix(sensitivities, constant=constant, windability="standard")
assert np.isclose(of_array.best.cost, under_field.best.cost, rtol=1e-9)
rates = cw.evaluate(coil, ["qua", under_field.pattern], field=own_field)
assert isinstance(rates, cw.FieldEvaluateResult)
cw.plot_rates(rates, own_field)
plt.show()
