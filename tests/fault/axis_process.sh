# Sourced by the tests of an axis on a PC of its own: the process `motion` of a cell file, on the host `stage-pc`.
# axis_process PACE LIMITS [LINE]: PACE is the line that says how often it is stepped, LINE a further one of the stage.
axis_process() {
  cat <<Y
  motion:
    host: stage-pc
    $1
    components:
      world: {type: simulated_stage, machine: machine.yaml, connect: {motor_x: stage_x.motor}}
      stage_x:
        type: stage
        travel: [0, 0.2]
        following_error: 0.05
        feedback_timeout: 0.1
        limits: $2
        control: {kp: 400, ki: 0, kd: 40, velocity_filter: 50, feedforward_velocity: 1.5, feedforward_acceleration: 0.2667}
        connect: {feedback: world.feedback_x}
        ${3:-}
Y
}
