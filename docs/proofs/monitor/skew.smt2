; skew: theory §3.2. A reading and a switch that are at most s apart: the error of the work is that of
; the reading and v s more, and a displacement over a time that is up to s longer loses no less than
; is counted with s more.
(set-logic QF_NRA)
(declare-const f Real)   ; |dF|
(declare-const h Real)   ; error of the encoder along it
(declare-const v Real)   ; fastest hand
(declare-const s Real)
(declare-const t Real)   ; between the reading and the switch
(declare-const xm Real)  ; measured
(declare-const xr Real)  ; true, at the reading
(declare-const xs Real)  ; true, at the switch
(declare-const B Real)   ; measured duration
(declare-const d Real)   ; displacement
(declare-const n Real)   ; d^2 over the true duration
(declare-const m Real)   ; d^2 over the duration that counts
(assert (and (>= f 0) (>= h 0) (>= v 0) (>= t 0) (> B 0)))
(assert (and (<= (- xm xr) h) (<= (- xr xm) h)))
(assert (and (<= (- xs xr) (* v t)) (<= (- xr xs) (* v t))))
(assert (<= t s))  ; dropped in the twin
(assert (= (* n (+ B t)) (* d d)))
(assert (= (* m (+ B s)) (* d d)))
(assert (<= (* v t) (* v s)))  ; hint
(assert (and (<= (- xm xs) (+ h (* v s))) (<= (- xs xm) (+ h (* v s)))))  ; hint
(assert (or (> (* f (- xm xs)) (* f (+ h (* v s)))) (> (* f (- xs xm)) (* f (+ h (* v s)))) (> m n)))  ; negated conclusion
(check-sat)
