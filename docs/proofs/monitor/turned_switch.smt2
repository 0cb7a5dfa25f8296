; turned_switch: theory §3.2. A change of the torques whose force is c where the arm was read acts from
; a place that is up to w away on: its mean force m over the way x there is at most c (1 + k x), k the
; change of the force per metre, so its work is at most c w (1 + k w).
(set-logic QF_NRA)
(declare-const c Real)
(declare-const k Real)
(declare-const w Real)
(declare-const x Real)
(declare-const m Real)
(assert (and (>= c 0) (>= k 0) (<= 0 x) (<= x w)))
(assert (and (<= m (* c (+ 1 (* k x)))) (<= (- m) (* c (+ 1 (* k x))))))  ; dropped in the twin
(assert (<= (* k x) (* k w)))  ; hint
(assert (<= (* c (+ 1 (* k x))) (* c (+ 1 (* k w)))))  ; hint
(assert (<= (* x (* c (+ 1 (* k x)))) (* w (* c (+ 1 (* k w))))))  ; hint
(assert (or (> (* m x) (* w (* c (+ 1 (* k w))))) (> (* (- m) x) (* w (* c (+ 1 (* k w)))))))  ; negated conclusion
(check-sat)
