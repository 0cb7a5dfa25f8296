; slew: theory §3. A switch that grows by at most s beyond what acts in the command's direction changes
; the force by at most |F_a| + s. f: the command's norm, a: component of the acting force along it.
(set-logic QF_NRA)
(declare-const f Real)
(declare-const a Real)
(declare-const n Real)  ; |F_a|
(declare-const s Real)  ; slew times the time since the last answer
(declare-const c Real)  ; |F - F_a|
(assert (and (>= f 0) (>= n 0) (>= s 0) (<= a n) (>= a (- n)) (>= c 0)))
(assert (= (* c c) (+ (* f f) (* (- 2) f a) (* n n))))
(assert (<= f (+ s (ite (> a 0) a 0))))  ; dropped in the twin
(assert (=> (> c (+ n s)) (> (* c c) (* (+ n s) (+ n s)))))  ; hint
(assert (=> (> a 0) (<= (* (- f a) (- f a)) (ite (> (- f a) 0) (* s s) (* a a)))))  ; hint
(assert (=> (<= a 0) (<= (* (- f) a) (* f n))))  ; hint
(assert (> c (+ n s)))  ; negated conclusion
(check-sat)
