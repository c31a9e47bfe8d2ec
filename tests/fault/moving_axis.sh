# Sourced by the tests of an axis that moves (they set $source): makes $folder with cell.yaml in it. A simulated axis (the process "plant"), its
# stage ("servo"), 180 mm at 50 mm/s and four strokes of 160 mm (the job "move" in "trials") and a recorder, by the wall clock.
source "$source/tests/support/claims.sh"
folder=$(mktemp -d)
cp "$source/deployment/profiles.yaml" "$folder"
cp "$source/deployment/machines/xy-table-nominal.yaml" "$folder/machine.yaml"
cat > "$folder/cell.yaml" <<C
invar_cell: 1
name: moving
domain: $domain
profiles: profiles.yaml
hosts: {pc: {address: 127.0.0.1}}
processes:
  plant:
    host: pc
    rate: 1000
    components:
      world: {type: simulated_stage, machine: machine.yaml, connect: {motor_x: stage_x.motor}}
  servo:
    host: pc
    rate: 1000
    components:
      stage_x:
        type: stage
        travel: [0, 0.2]
        feedback_timeout: 0.5
        following_error: 0.05
        limits: {velocity: 0.05, acceleration: 0.05, jerk: 10}
        control: {kp: 400, ki: 0, kd: 40, velocity_filter: 50, feedforward_velocity: 1.5, feedforward_acceleration: 0.2667}
        connect: {feedback: world.feedback_x}
  trials:
    host: pc
    rate: 100
    components:
      trial:
        type: axis_trial
        axis: 0
        motion: [{name: move, from: 0.18, to: 0.02, velocities: [0.05, 0.05, 0.05, 0.05]}]
        connect: {state: stage_x.state, command: stage_x.command}
  recorder: {host: pc, rate: 50, components: {recorder: {type: recorder}}}
jobs: {move: trial}
C
