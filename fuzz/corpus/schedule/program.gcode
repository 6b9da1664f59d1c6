; coilwright winding program, version 1
; X carriage in mm from the first flange, C spool in turns, clockwise seen from the first flange
; F in turns/min; T1 reel A, T2 reel B, T11 reel C1; M0 apply adhesive
; head {"schema_version":1,"document":"machine program 1","program":"coilwright 0.1.0","model":"paper 200 m","model_sha256":"9d31c68148c84501e95eaaf23c287e4334eddaecef86f5d26fca6203c68ef7ff","pattern":"qua","segments":[6,7,8,5,4,9,10,3,2,11,12,1],"windability":{"class":"standard","reels":2,"captive":0,"max_climb":3},"worst_rate_deg_per_h":4.336636,"worst_profile":"sampled-49","worst_time_s":5122.004794,"fibre":"250.0 µm over the coating, n 1.447 at 1300 nm","length_m":200.0,"midpoint_m":100.0,"midpoint_layer":1,"start_mark_m":100.0,"expected_trim_m":0.0,"reels":[{"name":"A","captive":false,"prepared_before_step":1,"taken_from":null,"from_m":0.0,"to_m":100.0,"load_m":103.0},{"name":"B","captive":false,"prepared_before_step":1,"taken_from":null,"from_m":100.0,"to_m":200.0,"load_m":103.0}],"production":{"part_number":"","revision":"","spool":"","tension_n":0.1,"tension_taper_percent_per_layer":0.0,"tension_limit_percent":10.0,"allowance_m":3.0,"adhesive":"","potting_every_layers":1,"cure":"","winding_speed_turns_per_min":60.0}}
G21
G90
; layer 1 step 1 half A segment 6 from 83.333333 to 100 length 16.666667 radius 36.125 climb 0 cumulative 16.666667 pitch 0.25 tension 0.1 least 0.09 most 0.11
; crossover 
T1 M6
G0 X0
G92 C0
G1 X17.6839 C-70.7355 F60
M0
; layer 2 step 2 half B segment 7 from 100 to 116.666667 length 16.666667 radius 36.375 climb 1 cumulative 16.666667 pitch 0.25 tension 0.1 least 0.09 most 0.11
; crossover first flange, from layer 1, 1 layer
T2 M6
G0 X0
G92 C0
G1 X17.6839 C70.7355 F60
M0
; layer 3 step 3 half B segment 8 from 116.666667 to 133.333333 length 16.666667 radius 36.625 climb 1 cumulative 33.333333 pitch 0.25 tension 0.1 least 0.09 most 0.11
; crossover second flange, from layer 2, 1 layer
T2
G0 X17.6839
G92 C0
G1 X0 C70.7355 F60
M0
; layer 4 step 4 half A segment 5 from 66.666667 to 83.333333 length 16.666667 radius 36.875 climb 3 cumulative 33.333333 pitch 0.25 tension 0.1 least 0.09 most 0.11
; crossover second flange, from layer 1, 3 layers
T1 M6
G0 X17.6839
G92 C0
G1 X0 C-70.7355 F60
M0
; layer 5 step 5 half A segment 4 from 50 to 66.666667 length 16.666667 radius 37.125 climb 1 cumulative 50 pitch 0.25 tension 0.1 least 0.09 most 0.11
; crossover first flange, from layer 4, 1 layer
T1
G0 X0
G92 C0
G1 X17.6839 C-70.7355 F60
M0
; layer 6 step 6 half B segment 9 from 133.333333 to 150 length 16.666667 radius 37.375 climb 3 cumulative 50 pitch 0.25 tension 0.1 least 0.09 most 0.11
; crossover first flange, from layer 3, 3 layers
T2 M6
G0 X0
G92 C0
G1 X17.6839 C70.7355 F60
M0
; layer 7 step 7 half B segment 10 from 150 to 166.666667 length 16.666667 radius 37.625 climb 1 cumulative 66.666667 pitch 0.25 tension 0.1 least 0.09 most 0.11
; crossover second flange, from layer 6, 1 layer
T2
G0 X17.6839
G92 C0
G1 X0 C70.7355 F60
M0
; layer 8 step 8 half A segment 3 from 33.333333 to 50 length 16.666667 radius 37.875 climb 3 cumulative 66.666667 pitch 0.25 tension 0.1 least 0.09 most 0.11
; crossover second flange, from layer 5, 3 layers
T1 M6
G0 X17.6839
G92 C0
G1 X0 C-70.7355 F60
M0
; layer 9 step 9 half A segment 2 from 16.666667 to 33.333333 length 16.666667 radius 38.125 climb 1 cumulative 83.333333 pitch 0.25 tension 0.1 least 0.09 most 0.11
; crossover first flange, from layer 8, 1 layer
T1
G0 X0
G92 C0
G1 X17.6839 C-70.7355 F60
M0
; layer 10 step 10 half B segment 11 from 166.666667 to 183.333333 length 16.666667 radius 38.375 climb 3 cumulative 83.333333 pitch 0.25 tension 0.1 least 0.09 most 0.11
; crossover first flange, from layer 7, 3 layers
T2 M6
G0 X0
G92 C0
G1 X17.6839 C70.7355 F60
M0
; layer 11 step 11 half B segment 12 from 183.333333 to 200 length 16.666667 radius 38.625 climb 1 cumulative 100 pitch 0.25 tension 0.1 least 0.09 most 0.11
; crossover second flange, from layer 10, 1 layer
T2
G0 X17.6839
G92 C0
G1 X0 C70.7355 F60
M0
; layer 12 step 12 half A segment 1 from 0 to 16.666667 length 16.666667 radius 38.875 climb 3 cumulative 100 pitch 0.25 tension 0.1 least 0.09 most 0.11
; crossover second flange, from layer 9, 3 layers
T1 M6
G0 X17.6839
G92 C0
G1 X0 C-70.7355 F60
M0
M30
