"""Regimes of failure: minimal scenes, each with one severity that grows (`benchharness.regime`).

What is known to go wrong has a number: F for vertices that are moved, I for images that are looked up, P for flat mirrors.
The regimes that show it, or where else it is tested, or why no method here can meet it:

    F-01 grazing                       grazing incidence
    F-02 in_plane                      eye, vertex and axis in one plane: the secant's triangle is a sliver
    F-03 in_line                       eye, axis and vertex in one line: the secant's equations are degenerate
    F-04 tests/kernels/vertices/test_secant_oracle.py   equation (1) as it is printed
    F-05 tests/kernels/vertices/test_secant_oracle.py   least squares of the wrong vectors
    F-06 hidden                        hidden vertices
    F-07 tests/methods/test_image_space_search.py  the sign of the mirrored vertex
    F-08 in_line                       vertex straight behind the mirror's point
    F-09 open_cap                      reflection point beyond the rim
    F-10 cut_off                       mirror partly out of the picture
    F-11 torus                         search that starts where the mirror has a hole
    F-12 hidden                        triangles that fold over
    F-13 hidden                        triangles half in the shadow
    F-14 long_triangles                long triangles
    F-15 perturbed, t_junctions        cracks between neighbours
    F-16 layers                        thin layers fight
    F-17 flicker                       flicker of texels
    F-18 telephoto                     plateaus of single precision
    F-19 basin, cut, jump              starts that are out of date
    F-20 concave, zones                several images in a concave mirror
    F-21 concave, focal                the focus, where magnification has no bound
    F-22 bowl                          second bounce in a bowl
    F-23 torus                         mirror that is not star-shaped
    F-24 pole                          poles of a parametrisation
    F-25 bumps, torus                  convex in one direction, concave in the other
    F-26 bumps, lobes                  mirror that stands before itself
    F-27 sheet                         sheet without a back
    F-28 tests/kernels/vertices/test_virtual_depth.py   the wrong depth compared with the mirror's back
    F-29 contact                       contact
    F-30 dipping                       object that goes into the mirror
    F-31 near_eye                      eye near the mirror
    F-32 shell                         explosion map, off its sphere
    F-33 coarse_mirror                 coarse mirror
    F-34 far_away                      far vertices
    F-35 two_mirrors                   mirrors in mirrors

    I-01 contact                       no parallax
    I-02 contact                       contact with a billboard
    I-03 edge_on                       billboard seen edge-on
    I-04 around                        object around the mirror
    I-05 other_side                    no parallax within a billboard
    I-06 foliage                       edges of transparency
    I-07 two_mirrors                   second order
    I-08 border                        the ground's border in the panorama
    I-09 border                        directions that cancel where ground passes into panorama
    I-10 at_camera                     ray through a depth map's camera
    I-11 at_camera                     ray that starts behind a depth map's camera
    I-12 comb                          more spans than a row has room for
    I-13 comb, gap                     gaps that are bridged
    I-14 behind                        a step of depth within an object
    I-15 other_side                    a side that no picture has
    I-16 spokes                        rows at few angles
    I-17 spokes                        the angle at which rows start anew
    I-18 plate                         corners beyond the turned rows
    I-19 other_side                    ray that comes from behind a surface
    I-20 palisade                      distances with things in between
    I-21 tests/methods/test_distance_impostor.py  rays that start behind what a map of distances sees
    I-22 next_room                     mirror that leaves the box of its room
    I-23 between_maps                  midway between maps
    I-24 off_screen, screened          what the picture on the screen does not show
    I-25 tests/methods/test_screen_space.py  squares of a pyramid of depths, and their edges
    I-26 corner                        edges and corners of a cube map
    I-27 far_away                      mirror in its own environment map, where it would hide everything
    I-28 off_wall                      what stands off the walls of a box

    P-01 tilted                        what lies before the mirror's plane, and touches it
    P-02 skimming                      eye near the mirror's plane
    P-03 thin_box                      front and back exchanged
    P-04 curved_highlight, highlight   highlights of the wrong viewer
    P-05 tests/methods/test_planar_mirror.py  oblique near plane: the sky, what is far, the other side
    P-06 tests/methods/test_planar_mirror.py  how many pictures facing mirrors take
    P-07 frame_edge                    edge of a flat mirror
    P-08 around_slab                   eye behind a flat mirror
    P-09 skimming                      plane seen edge-on
    P-10 thick_slab                    the mirror's own back
    P-11 backed                        what lies behind a flat mirror
"""
