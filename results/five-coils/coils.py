BASE = '''name = "{name}"
[fibre]
refractive_index = 1.456
thermo_optic_per_k = 1.0e-5
wavelength_nm = 1550.0
outer_diameter_um = {d}
[winding]
layers = {n}
turns_per_layer = {m}
inner_diameter_mm = {di}
radial_pitch_um = {p}
axial_pitch_um = {ax}
layer_length = "{ll}"
pattern = "{pattern}"
[thermal]
model = "pack"
conductivity_w_per_m_k = {k}
volumetric_heat_capacity_j_per_m3_k = {c}
[sensor]
location = "{loc}"
{effects}
[profiles]
max_rate_c_per_h = 60.0
count = 64
segments = {seg}
duration_s = {dur}
seed = SEED
[search]
windability = "standard"
seed = 1
'''
film = lambda h: f'[[effect]]\nkind = "surface_film"\nfilm_w_per_m2_k = {h}\n'
C = {
 'c12': dict(name='c12', d=250, n=12, m=40, di=75, p=250, ax=260, ll='actual', k=0.4, c=1.8e6, loc='outer_layer', effects='', seg=4, dur=4000),
 'c16': dict(name='c16', d=165, n=16, m=60, di=60, p=170, ax=170, ll='actual', k=0.3, c=1.7e6, loc='ambient', effects=film(15)+'[[effect]]\nkind = "spool_mass"\nheat_capacity_j_per_m2_k = 3000.0\ncontact_w_per_m2_k = 100.0\n', seg=6, dur=6000),
 'c24': dict(name='c24', d=165, n=24, m=60, di=80, p=170, ax=172, ll='actual', k=0.35, c=1.7e6, loc='ambient', effects=film(80), seg=3, dur=3000),
 'c32': dict(name='c32', d=165, n=32, m=80, di=100, p=170, ax=172, ll='actual', k=0.30, c=1.8e6, loc='ambient', effects=film(25)+'[[effect]]\nkind = "strain_mismatch"\nmismatch = 0.002\n', seg=4, dur=5000),
 'f14': dict(name='f14', d=250, n=14, m=52, di=90, p=255, ax=258, ll='actual', k=0.28, c=1.9e6, loc='ambient', effects=film(40), seg=5, dur=5000, pattern='sym'),
 'f20': dict(name='f20', d=165, n=20, m=66, di=72, p=171, ax=173, ll='actual', k=0.33, c=1.75e6, loc='ambient', effects=film(35)+'[[effect]]\nkind = "spool_mass"\nheat_capacity_j_per_m2_k = 5000.0\ncontact_w_per_m2_k = 250.0\nmount_w_per_m2_k = 20.0\n', seg=4, dur=5000),
 'f28': dict(name='f28', d=165, n=28, m=72, di=95, p=170, ax=172, ll='actual', k=0.38, c=1.8e6, loc='outer_layer', effects='', seg=6, dur=4500),
 'c48': dict(name='c48', d=135, n=48, m=70, di=110, p=137, ax=140, ll='actual', k=0.35, c=1.7e6, loc='ambient', effects=film(300), seg=5, dur=4000),
}
C['g18'] = dict(name='g18', pattern='sym', d=165, n=18, m=75, di=85, p=169, ax=171, ll='actual', k=0.31, c=1.85e6, loc='ambient', effects=film(60), seg=5, dur=4500)
C['g22'] = dict(name='g22', pattern='sym', d=200, n=22, m=50, di=70, p=205, ax=207, ll='actual', k=0.36, c=1.8e6, loc='ambient', effects=film(18), seg=4, dur=6000)
def model(name, seed, out, **kw):
    t = BASE.format(**{'pattern': 'qua', **C[name], **kw}).replace('SEED', str(seed))
    open(out, 'w').write(t)
