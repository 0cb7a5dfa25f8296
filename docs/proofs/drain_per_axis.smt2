; drain_per_axis: theory §2.4. With friction per axis and e_i = (|F_i| - fco_i)+ the extracted power
; is also at most |e||v| - fdmin |v|^2, the bound that matters where the speed is bounded. Here
; a_i = |v_i|, p_i the power that axis i gives.
(set-logic QF_NRA)
(declare-const e1 Real)
(declare-const e2 Real)
(declare-const e3 Real)
(declare-const a1 Real)
(declare-const a2 Real)
(declare-const a3 Real)
(declare-const f1 Real)
(declare-const f2 Real)
(declare-const f3 Real)
(declare-const fm Real)  ; least viscous friction
(declare-const e Real)   ; |e|
(declare-const v Real)   ; |v|
(assert (and (>= e1 0) (>= e2 0) (>= e3 0) (>= a1 0) (>= a2 0) (>= a3 0)))
(assert (and (>= fm 0) (>= f1 fm) (>= f2 fm) (>= f3 fm)))
(assert (and (>= e 0) (= (* e e) (+ (* e1 e1) (* e2 e2) (* e3 e3)))))  ; dropped in the twin
(assert (and (>= v 0) (= (* v v) (+ (* a1 a1) (* a2 a2) (* a3 a3)))))
(assert (>= (* e v) (+ (* e1 a1) (* e2 a2) (* e3 a3))))  ; hint
(assert (and (>= (* (- f1 fm) a1 a1) 0) (>= (* (- f2 fm) a2 a2) 0) (>= (* (- f3 fm) a3 a3) 0)))  ; hint
(assert (> (- (+ (* e1 a1) (* e2 a2) (* e3 a3)) (* f1 a1 a1) (* f2 a2 a2) (* f3 a3 a3)) (- (* e v) (* fm v v))))  ; negated conclusion
(check-sat)
