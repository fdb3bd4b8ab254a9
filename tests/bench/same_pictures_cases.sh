# The cases of same_pictures.sh, sourced by it. Inputs that are grown or written are those of the old side, for both.
#   grown NAME ARGS...     `stipple grow`: an input, and a case of its own (bytes)
#   store NAME ARGS...     `stipple build`; {NAME.las} is an input, @PATH a file of STIPPLE_DATA (unpacked where it ends
#                          in .gz), skipped where it is missing
#   converted NAME ARGS... `stipple convert`
#   placed NAME %STORE SCALE,X,Y,Z ...  a glTF scene that places stores
#   picture NAME ARGS...   `stipple render`; %NAME is a store of above. `on NAME=VALUE picture ...` sets its environment.

grown scan.las scan --points 150k --origin 500000,5400000,300
grown near.ply scan --points 40k --seed 3
grown oak.glb tree --leaves 3000
grown birch.glb tree --species birch --leaves 1500 --as triangles
grown orchard.glb orchard --leaves 1500 --rows 3
grown forest.glb forest --trees 300 --leaves 1500 --variants 1
grown meadow.glb meadow --size 8
grown rock.glb rock --triangles 30k --texture 256
grown building.glb building --triangles 20k --texture 128
grown terrain.glb terrain --triangles 30k --texture 256

# Points.
store scan {scan.las}
store scan_fine {scan.las} --normals fine
store scan_bare {scan.las} --normals none --threads 1
store scan_all {scan.las} --attributes all --duplicates merge
store scan_spilled {scan.las} --memory 160M --attributes all
store near {near.ply} --up z
store ball {ball.ply}
store ball_kept {ball.ply} --normals keep --radii keep --up y
store ahn3 @02_scans/als_ahn3_delft/ahn3_cropped_2.laz --attributes all
store tiles @02_scans/als_lasR_bcts/bcts_1.laz @02_scans/als_lasR_bcts/bcts_2.laz
store megaplot @02_scans/als_lasR_misc/Megaplot.laz --attributes all --drop-outliers
store pine @02_scans/forest_tls_TreeLS/pine.laz --normals fine
store pond @02_scans/photogrammetry_ply/pond.0.ply
store autzen @02_scans/las_versions/autzen_trim.laz --attributes all
store waveform @02_scans/las_pdrf_matrix/pdrf9-1.4.laz --attributes all
store mobile @02_scans/ecef_itowns_potree_laz_12M/data/r/41160
store bunny @01_meshes/bunny/bun_zipper.ply --only-points
store range @01_meshes/happy_stand_rangescans/happyStandRight_0.ply --only-points

# Triangles.
store rock {rock.glb}
store building {building.glb}
store terrain {terrain.glb}
store surfels {rock.glb} --surfels 40k
store horse @01_meshes/misc/horse.ply
store lucy @01_meshes/misc/lucy.ply --memory 300M
store helmet @06_gltf/DamagedHelmet.glb
store oaktree @04_plants/gltf/oaktree.gltf

# Ribbons and tubes.
store oak {oak.glb}
store neuron @05_tubes/swc_NeuroM/Neuron.swc
store thin @05_tubes/swc_NeuroM/Neuron_small_radius.swc --strand-radius 0.5
store fur @05_tubes/hair/fur.hair
store stroke @05_tubes/streamlines_niivue/stroke.trk.gz --memory 512M
store qsm @05_tubes/qsm/Tree_1_TreeQSM.txt
converted birch_curves {birch.glb} --strands
placed hybrid %ball 1,0,0,0 %rock 0.5,1.2,0,0.3 %oak 0.25,-0.9,-1,0.2
placed pair %ball 1,0,0,0 %rock 1,1.5,0,0

# Scans on cpu: modes, odd and even sizes, errors, budgets, alpha, depth and normals, colours.
picture scan %scan --size 640x360
picture scan_odd %scan --size 641x359 --error 0.3
picture scan_tiny %scan --size 1x1
picture scan_flat.exr %scan --size 320x181 --alpha --shade lit
picture scan_points %scan --size 640x360 --mode points
picture scan_points.exr %scan --size 321x200 --mode points --alpha
picture scan_budget %scan --size 640x360 --budget-points 20k
picture scan_resident %scan --size 320x200 --resident 3M
picture scan_close %scan --size 480x270 --eye=500002,5399990,304 --target=500002,5400000,301 --shade lit
picture scan_within %scan --size 320x241 --eye=500000.5,5400000.5,300.6 --target=500003,5400002,300.5 --fov 100
picture scan_fine %scan_fine --size 640x360 --shade lit
picture scan_bare %scan_bare --size 320x180 --background 10,200,30
picture scan_intensity %scan_all --size 480x270 --colour intensity --colour-map turbo --legend
picture scan_height %scan --size 301x170 --colour height --colour-range 300,310
picture near_lit %near --size 400x300 --shade lit --environment @07_env/hdr/venice_sunset_256.hdr
on STIPPLE_SIMD=sse picture ball_sse %ball --size 320x240 --shade lit
on STIPPLE_SIMD=avx2 picture ball_avx2 %ball --size 320x240 --shade lit
picture ball_level %ball --size 320x240 --debug level --error 4
picture ball_error %ball --size 320x240 --debug error --error 4
picture ball_holes %ball --size 320x240 --debug holes
picture ball_normals %ball --size 320x240 --debug normals
picture ball_points %ball --size 321x241 --mode points --shade lit
picture ball_coarse.exr %ball_kept --size 320x240 --alpha --error 16
picture ahn3 %ahn3 --size 640x400 --colour class --legend
picture tiles %tiles --size 640x400
picture megaplot %megaplot --size 480x320 --colour return
picture pine %pine --size 300x500
picture pond %pond --size 480x320
picture autzen %autzen --size 480x320 --error 2
picture mobile %mobile --size 481x321
picture bunny %bunny --size 480x480 --shade lit
picture range.exr %range --size 320x320 --alpha

# Triangles on cpu.
picture rock %rock --size 640x480
picture rock.exr %rock --size 321x241 --alpha --error 3
picture rock_normals %rock --size 320x240 --debug normals
picture building %building --size 640x480 --environment @07_env/polyhaven/noon_grass_1k.hdr --environment-scale 0.7
picture terrain %terrain --size 640x360 --error 2
picture terrain_points %terrain --size 320x180 --mode points
picture surfels %surfels --size 320x240
picture horse %horse --size 480x360
picture lucy_close %lucy --size 321x481 --fov 20
picture helmet %helmet --size 480x480 --environment @07_env/hdr/venice_sunset_256.hdr
picture oaktree %oaktree --size 320x320 --alpha

# Ribbons, tubes, wind, instances, hybrids on cpu.
picture oak %oak --size 480x480
picture oak_wind %oak --size 480x480 --wind 0.05 --time 1.5
picture oak_far %oak --size 64x65 --error 2
picture oak.exr %oak --size 240x320 --alpha --strand-exact 1
picture oak_accumulated %oak --size 160x160 --accumulate 4
picture oak_points %oak --size 200x200 --mode points
picture neuron %neuron --size 480x360
picture thin %thin --size 240x180 --strand-exact 0.5
picture fur %fur --size 480x360 --accumulate 2
picture stroke %stroke --size 480x360
picture qsm.exr %qsm --size 201x301 --alpha
picture birch_curves %birch_curves --size 300x400
picture orchard {orchard.glb} --size 640x360
picture forest {forest.glb} --size 640x360 --error 2
picture forest_wind {forest.glb} --size 640x360 --error 2 --wind 0.03 --time 2.25
picture forest_level {forest.glb} --size 320x180 --error 4 --debug level
picture forest_within {forest.glb} --size 320x180 --eye=0,1.8,14 --target=0,6,-40 --fov 60
picture meadow {meadow.glb} --size 480x270 --wind 0.1 --time 0.4
picture hybrid %hybrid.gltf --size 480x360 --error 0.5
picture hybrid.exr %hybrid.gltf --size 241x181 --alpha
picture orbit %pair.gltf --size 160x120 --orbit 3

# Software Vulkan.
picture gpu_scan %scan --size 640x360 --device gpu:llvmpipe
picture gpu_scan_odd.exr %scan --size 321x181 --alpha --device gpu:llvmpipe
picture gpu_points %scan --size 320x180 --mode points --device gpu:llvmpipe
picture gpu_ball_level %ball --size 320x240 --debug level --error 4 --device gpu:llvmpipe
picture gpu_rock %rock --size 320x240 --environment @07_env/hdr/venice_sunset_256.hdr --device gpu:llvmpipe
picture gpu_terrain %terrain --size 321x181 --error 2 --device gpu:llvmpipe
picture gpu_oak %oak --size 240x240 --wind 0.05 --time 1.5 --device gpu:llvmpipe
picture gpu_fur %fur --size 240x180 --device gpu:llvmpipe
picture gpu_forest {forest.glb} --size 320x180 --error 2 --device gpu:llvmpipe
picture gpu_hybrid.exr %hybrid.gltf --size 240x180 --alpha --device gpu:llvmpipe

# The fp64 restatement, and rays.
picture restated_scan %scan --size 160x90 --device reference
picture restated_points %scan --size 161x91 --mode points --device reference
picture restated_rock.exr %rock --size 120x90 --alpha --device reference
picture restated_oak %oak --size 120x120 --wind 0.05 --time 1.5 --device reference
picture restated_forest {forest.glb} --size 120x68 --error 4 --device reference
picture restated_hybrid %hybrid.gltf --size 121x91 --device reference
picture traced_ball %ball --size 120x90 --mode reference --samples 2
picture traced_rock.exr %rock --size 120x90 --mode reference --samples 1 --alpha
picture traced_oak %oak --size 90x91 --mode reference --samples 2
