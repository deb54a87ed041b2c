import ospgrillage as og

from skthermo.fem import probe


def bridge(theta):
    girders, slab = (og.create_material(E=34e9 * t, G=14e9 * t, v=0.2, rho=2.5) for t in theta)
    beam = og.create_section(A=0.9, J=0.13, Iy=0.21, Iz=0.26)
    edge = og.create_section(A=0.05, J=3e-4, Iy=3e-4, Iz=2e-4)
    plate = og.create_section(A=0.2, J=1.3e-3, Iy=7e-4, Iz=7e-4, unit_width=True)
    end = og.create_section(A=0.1, J=7e-4, Iy=4e-4, Iz=4e-4)
    size = {"long_dim": 20, "width": 8, "skew": 10, "num_long_grid": 7, "num_trans_grid": 9, "edge_beam_dist": 1}
    grillage = og.create_grillage(bridge_name="bridge", mesh_type="Oblique", **size)
    members = {(beam, girders): ["interior_main_beam", "exterior_main_beam_1", "exterior_main_beam_2"]}
    members |= {(edge, girders): ["edge_beam"], (plate, slab): ["transverse_slab"]}
    members |= {(end, slab): ["start_edge", "end_edge"]}
    for (section, material), names in members.items():
        for name in names:
            grillage.set_member(og.create_member(section=section, material=material), member=name)
    grillage.create_osp_model(pyfile=False)
    return grillage


def matrices(theta):
    mass, _, stiffness = bridge(theta).get_MCK()
    return stiffness, mass


model = probe(matrices, ["E_girders", "E_slab"], n_modes=4, n_checks=0)
